#!/usr/bin/python3
"""Renders a small picture with scripts/farm on a Slurm cluster of its own, kills one part, puts another back into the queue, and compares the
merged picture with that of one machine. Before, interrupts the submission of jobs to commands that only pretend to be Slurm's.

The argument is the folder of the tools. The cluster is this machine: munged, slurmctld and slurmd run as the current user, with all files in
a temporary folder and bound to the loopback interface. Exits with 77 if Slurm or MUNGE is not installed (scripts/setup --dev installs
them), after the checks that need neither.
"""

import contextlib
import getpass
import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
SKIPPED = 77
PARTS = 4
SPP = 256
PROGRAMS = ("munged", "mungekey", "slurmctld", "slurmd", "sbatch", "squeue", "scontrol")
# One node with enough processors for all parts, however many the machine has.
CONFIGURATION = """
ClusterName=lobe
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CryptoType=crypto/munge
SlurmUser={user}
SlurmdUser={user}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=sched_interval=1,sched_min_interval=100000,bf_interval=1
SlurmdParameters=config_overrides
ReturnToService=2
KillWait=2
MpiDefault=none
NodeName={host} NodeAddr=127.0.0.1 CPUs={cpus} State=UNKNOWN
PartitionName=all Nodes={host} Default=YES State=UP
"""


def free_ports(count):
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        return [one.getsockname()[1] for one in sockets]


def until(condition, what, seconds=300):
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"after {seconds} s: {what}")
        time.sleep(0.05)


class Cluster:
    """A Slurm cluster of one node in a folder, which ends with the context."""

    def __init__(self, folder):
        self.folder, self.processes, self.hastened = folder, [], set()
        for name in ("state", "spool"):
            (folder / name).mkdir(parents=True)
        host = socket.gethostname().split(".")[0]
        (folder / "slurm.conf").write_text(CONFIGURATION.format(host=host, folder=folder, ports=free_ports(2), user=getpass.getuser(),
                                                                cpus=PARTS * os.cpu_count()))
        self.environment = os.environ | {"SLURM_CONF": str(folder / "slurm.conf")}

    def __enter__(self):
        try:
            self.start_all()
        except BaseException:
            self.__exit__(*sys.exc_info())
            raise
        return self

    def start_all(self):
        key = self.folder / "munge.key"
        subprocess.run(["mungekey", "--create", "--keyfile", key], check=True)
        self.start("munged", "--foreground", "--force", "--key-file", key, "--num-threads", "2",
                   *(f"--{name}={self.folder / file}" for name, file in (("socket", "munge.socket"), ("pid-file", "munged.pid"),
                                                                          ("seed-file", "munged.seed"))))
        until((self.folder / "munge.socket").exists, "munged does not start")
        self.start("slurmctld", "-D", "-i")
        self.start("slurmd", "-D")
        until(lambda: "idle" in self.run("sinfo", "--noheader", "--format=%t"), "the node does not become idle")

    def __exit__(self, *error):
        if error[0]:  # jobs would outlive slurmd
            self.run("scancel", "--user", getpass.getuser())
            end = time.monotonic() + 10
            while self.run("squeue", "--noheader") and time.monotonic() < end:
                time.sleep(0.1)
        for process in reversed(self.processes):
            process.terminate()
        for process in self.processes:
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
        if error[0]:
            for log in sorted(self.folder.rglob("*.log")):
                if not log.name.endswith(".out.log"):
                    print(f"== {log.name}\n{log.read_text(errors='replace')[-3000:]}")

    def start(self, *command):
        with open(self.folder / f"{command[0]}.out.log", "w") as log:
            self.processes.append(subprocess.Popen(texts(*command), env=self.environment, stdout=log, stderr=log))

    def run(self, *command):
        return subprocess.run(texts(*command), env=self.environment, capture_output=True, text=True).stdout

    def popen(self, command):
        self.processes.append(subprocess.Popen(texts(*command), env=self.environment))
        return self.processes[-1]

    def hasten(self):
        """Starts jobs soon that were put back into the queue. Slurm waits two minutes; nodes refuse a job within the second of its end."""
        for line in self.run("squeue", "--noheader", "--array", "--format=%i %r").splitlines():
            job, reason = line.split(maxsplit=1)
            if reason == "BeginTime" and job not in self.hastened:
                self.hastened.add(job)
                self.run("scontrol", "update", f"JobId={job}", "StartTime=now+3")


class Picture:
    """The demo scene, small, on the cluster."""
    size = ["--size", "96x60"]
    training = ["--passes", "2", "--photons", "20000", "--importons", "10000"]

    def __init__(self, tools, folder, cluster):
        self.tools, self.cluster, self.out = tools, cluster, folder / "picture.exr"
        self.parts = folder / "picture.farm"
        self.command = [ROOT / "scripts/farm", ROOT / "scenes/jewelry.xml", "-o", self.out, "--spp", SPP, "--parts", PARTS, "--tools", tools,
                        "--sbatch", f"-c {os.cpu_count()}", "--wait", "--", *self.size, *self.training, "--snapshot-every", "0.1"]

    def whole(self):
        """The picture of one machine."""
        target = self.out.with_name("whole.exr")
        subprocess.run(texts(self.tools / "loberender", ROOT / "scenes/jewelry.xml", "--cache", self.parts / "lobes", "--spp", SPP, "-o", target,
                             *self.size, *self.training), check=True)
        return target

    def log(self, part):
        log = self.parts / f"part-{part}.log"
        return log.read_text() if log.exists() else ""

    def process(self, part):
        """The loberender of a part."""
        for folder in pathlib.Path("/proc").iterdir():
            with contextlib.suppress(OSError):
                if folder.name.isdigit():
                    words = (folder / "cmdline").read_bytes().split(b"\0")
                    if words[0] == str(self.tools / "loberender").encode() and str(self.parts / f"part-{part}.ckpt").encode() in words:
                        return int(folder.name)
        return None

    def suspended(self, part):
        """Suspends a part as soon as it has a checkpoint with samples, so that it cannot end before what follows, and returns its process."""
        snapshot, checkpoint = self.parts / f"part-{part}.partial.exr", self.parts / f"part-{part}.ckpt"
        # A snapshot is written first, then the checkpoint of the same samples.
        until(lambda: snapshot.exists() and checkpoint.stat().st_mtime_ns > snapshot.stat().st_mtime_ns, f"part {part} does not start")
        process = self.process(part)
        assert process, f"part {part} has ended already"
        os.kill(process, signal.SIGSTOP)
        return process

    def interrupt(self):
        """Interrupts three of the four parts, each in another way."""
        job = json.loads((self.parts / "jobs.json").read_text())[2]
        killed, moved, late = (self.suspended(part) for part in range(3))
        os.kill(killed, signal.SIGKILL)
        self.cluster.run("scontrol", "requeue", f"{job}_1")
        # What Slurm does a minute before the time limit.
        self.cluster.run("scancel", "--batch", "--signal=USR1", f"{job}_2")
        for process in (moved, late):
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGCONT)


def texts(*command):
    return [str(part) for part in command]


def check_picture(tools, folder, cluster):
    picture = Picture(tools, folder, cluster)
    farm = cluster.popen(picture.command)
    until((picture.parts / "jobs.json").exists, "nothing is submitted")
    picture.interrupt()
    while farm.poll() is None:
        cluster.hasten()
        time.sleep(0.2)
    for part in range(PARTS):
        print(f"-- part {part}\n{picture.log(part)}")
    assert farm.returncode == 0, f"scripts/farm ends with {farm.returncode}"
    for part in range(3):
        assert "start 2" in picture.log(part) and "continues with sample" in picture.log(part), f"part {part} is not resumed"
    assert "exit code 137" in picture.log(0), "part 0 is not killed"
    errors = json.loads(subprocess.run(texts(tools / "lobecompare", picture.whole(), picture.out, "--json"), check=True, capture_output=True).stdout)[0]
    print(f"relmse of the merged picture and that of one machine: {errors['relmse']:.3g}")
    assert errors["relmse"] <= 1e-12 and errors["nonfinite"] == 0
    again = cluster.run(*picture.command)
    assert "complete already" in again, again


def check_frames(tools, folder, cluster):
    """A frame of one part has the bytes of a single run with its values."""
    render = ["-D", "height=6", "--spp", 4]
    subprocess.run(texts(ROOT / "scripts/farm", ROOT / "scenes/jewelry.xml", "-o", folder / "frame-{frame:03}.exr", "--parts", 1, "--frames", "8-9", *render,
                         "-D", "width={frame}", "--tools", tools, "--wait", "--", "--integrator", "path"), env=cluster.environment, check=True)
    for frame in (8, 9):
        whole = folder / "whole-frame.exr"
        subprocess.run(texts(tools / "loberender", ROOT / "scenes/jewelry.xml", "-o", whole, *render, "-D", f"width={frame}", "--integrator", "path"),
                       check=True)
        assert (folder / f"frame-00{frame}.exr").read_bytes() == whole.read_bytes(), f"frame {frame} differs"


def check_camera(tools, folder, cluster):
    """A value that only the file of the camera uses, which lobefit accepts; and options that are refused before anything is submitted."""
    camera = folder / "camera.xml"
    camera.write_text('<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="$angle"/></sensor></scene>')
    farm = [ROOT / "scripts/farm", ROOT / "scenes/jewelry.xml", "-o", folder / "camera.exr", "--spp", 1, "--parts", 1, "--tools", tools]
    script = cluster.run(*farm, "-D", "angle=40", "--dry-run", "--", "--camera", camera)
    fit = next(line for line in script.splitlines() if line.startswith("run ") and "lobefit" in line)
    subprocess.run(["bash", "-c", fit.removeprefix("run ").replace("$threads", "1") + " --check"], check=True, capture_output=True)
    refused = subprocess.run(texts(*farm, "--dry-run", "--", "--gradients", "l2"), capture_output=True, text=True)
    assert refused.returncode == 2 and "--gradients" in refused.stderr, refused.stderr


def check_failure(tools, folder, cluster):
    """A job that always fails ends the jobs that depend on it."""
    farm = cluster.popen([ROOT / "scripts/farm", ROOT / "scenes/jewelry.xml", "-o", folder / "failure.exr", "--spp", 4, "--parts", 2, "-D", "width=none",
                          "--retries", 0, "--tools", tools, "--wait"])
    assert farm.wait(300) == 1, "the failure is not reported"
    assert not cluster.run("squeue", "--noheader"), "jobs are left in the queue"


# Numbers its calls. The call FAILING runs FAILURE.
SBATCH = """#!/bin/bash
echo >>calls
number=$(wc -l <calls)
[ $number != "$FAILING" ] || eval "$FAILURE"
echo $number
"""


def pretended_farm(folder, *arguments, failing=0, failure="", code=0):
    """Runs scripts/farm with commands that only pretend to be Slurm's. Returns what it prints on stderr."""
    done = subprocess.run(texts(ROOT / "scripts/farm", ROOT / "scenes/jewelry.xml", "--spp", 4, "--parts", 2, "--tools", folder, *arguments), cwd=folder,
                          env=os.environ | {"PATH": f"{folder}:{os.environ['PATH']}", "FAILING": str(failing), "FAILURE": failure},
                          capture_output=True, text=True)
    assert done.returncode == code and "Traceback" not in done.stderr, (done.returncode, done.stderr)
    return done.stderr


def make_pretended_slurm(folder):
    folder.mkdir()
    for name, text in (("sbatch", SBATCH), ("scancel", '#!/bin/bash\necho "$*" >>cancelled\n'), ("squeue", "#!/bin/bash\n"), ("loberender", "")):
        (folder / name).write_text(text)
        (folder / name).chmod(0o755)


def check_submission(folder):
    """If not all jobs are submitted, those that are in the queue are cancelled, and the same command submits all of them."""
    make_pretended_slurm(folder)
    arguments = ("-o", "frame-{frame}.exr", "--frames", "0-9")
    cancelled, jobs = folder / "cancelled", folder / "frame.farm/jobs.json"
    # A fit, and three jobs for each frame. The signal arrives before sbatch prints the number of the job.
    for failure, code, numbers in (("kill -INT $PPID", 130, "1 2 3 4 5"), ("kill -TERM $PPID", 143, "1 2 3 4 5"), ("echo full >&2; exit 1", 1, "1 2 3 4")):
        errors = pretended_farm(folder, *arguments, failing=5, failure=failure, code=code)
        assert cancelled.read_text() == f"{numbers}\n" and not jobs.exists() and "cancelled: jobs 1 to " in errors, errors
        assert ("sbatch: full" in errors) == (code == 1), errors
        cancelled.unlink()
        (folder / "calls").unlink()
    pretended_farm(folder, *arguments)
    assert json.loads(jobs.read_text()) == [str(number) for number in range(1, 32)] and not cancelled.exists()


def check_folder(folder):
    """A number of the frame in the name of a folder does not become part of the name of the farm's folder."""
    make_pretended_slurm(folder)
    for name in ("d-1", "d-2", "1", "2"):
        (folder / name).mkdir()
    pretended_farm(folder, "-o", "d-{frame}/a.exr", "--frames", "1-2")
    pretended_farm(folder, "-o", "{frame}/{frame}.exr", "--frames", "1-2")
    assert not [path for path in folder.rglob("*") if "{" in path.name]
    assert (folder / "d/a.farm/plan.json").exists() and (folder / "frames/frames.farm/plan.json").exists()


def main():
    with tempfile.TemporaryDirectory(prefix="lobe-farm-") as name:
        check_submission(pathlib.Path(name) / "submission")
        check_folder(pathlib.Path(name) / "folder")
    os.environ["PATH"] += ":/usr/sbin:/sbin"
    missing = [program for program in PROGRAMS if not shutil.which(program)]
    if missing:
        print(f"skipped: not installed: {', '.join(missing)} (packages slurm-wlm and munge)")
        return SKIPPED
    tools = pathlib.Path(sys.argv[1]).resolve()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # the cluster ends with the test
    with tempfile.TemporaryDirectory(prefix="lobe-farm-") as name:
        folder = pathlib.Path(name)
        with Cluster(folder / "slurm") as cluster:
            check_camera(tools, folder, cluster)
            check_failure(tools, folder, cluster)
            check_frames(tools, folder, cluster)
            check_picture(tools, folder, cluster)
    print("the farm works")
    return 0


if __name__ == "__main__":
    sys.exit(main())
