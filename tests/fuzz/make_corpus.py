#!/usr/bin/python3
"""Makes initial corpora for the fuzz targets: small files of each kind, most of them written by the tools.

tests/fuzz/make_corpus.py TOOLS CORPUS
"""

import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import zlib

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
SCENE = """<scene version="3.0.0">
<default name="roughness" value="0.2"/>
<integrator type="path"><integer name="max_depth" value="6"/></integrator>
<sensor type="perspective"><float name="fov" value="40"/>
<transform name="to_world"><lookat origin="0,0,4" target="0,0,0" up="0,1,0"/></transform>
<film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="6"/><rfilter type="tent"/></film></sensor>
<texture type="checkerboard" id="squares"><rgb name="color0" value="0.2,0.4,0.6"/></texture>
<bsdf type="twosided" id="metal"><bsdf type="roughconductor"><float name="alpha" value="$roughness"/>
<spectrum name="eta" value="400:0.2, 700:1.4"/><string name="distribution" value="ggx"/></bsdf></bsdf>
<shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate x="1" angle="-60"/><translate y="-1"/></transform>
<bsdf type="diffuse"><ref id="squares" name="reflectance"/></bsdf></shape>
<shape type="sphere"><point name="center" x="0" y="0.2" z="0"/><float name="radius" value="0.6"/><ref id="metal"/></shape>
<shape type="rectangle"><transform name="to_world"><scale value="0.4"/><translate z="3"/></transform>
<emitter type="area"><rgb name="radiance" value="9"/></emitter></shape>
<emitter type="point"><point name="position" value="1,2,3"/><spectrum name="intensity" value="2"/></emitter>
</scene>
"""
OBJ = """mtllib a.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 1
vn 0 0 1
g square
usemtl red
f 1/1/1 2/2/1 3/1/1 4/2/1
f -4 -3 -2
"""
MTL = """newmtl red
Kd 0.8 0.1 0.1
Ks 0.2 0.2 0.2
Ns 30
d 0.5
illum 2
map_Kd -s 2 2 a.png
"""
PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
property float u
property float v
element face 1
property list uchar int vertex_indices
end_header
0 0 0 0 0
1 0 0 1 0
0 1 0 0 1
3 0 1 2
"""


def serialized(meshes):
    """A Mitsuba file with so many equal triangles in single precision, each a mesh."""
    body = struct.pack("<I", 0x1000) + b"a\0" + struct.pack("<QQ", 3, 1)
    body += struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0) + struct.pack("<3I", 0, 1, 2)
    mesh = struct.pack("<HH", 0x041C, 4) + zlib.compress(body)
    return meshes * mesh + struct.pack(f"<{meshes}QI", *(i * len(mesh) for i in range(meshes)), meshes)


def tensor_file():
    """A measured BRDF with the smallest sizes: all fields that the format names."""
    floats = {"phi_i": ([1], [0.0]), "theta_i": ([2], [0.0, 1.5]), "ndf": ([2, 2], [1.0] * 4), "sigma": ([2, 2], [1.0] * 4),
              "vndf": ([1, 2, 2, 2], [1.0] * 8), "luminance": ([1, 2, 2, 2], [1.0] * 8), "rgb": ([1, 2, 3, 2, 2], [0.5] * 24)}
    fields = [(name, 10, shape, struct.pack(f"<{len(values)}f", *values)) for name, (shape, values) in floats.items()]
    fields += [("description", 1, [4], b"test"), ("jacobian", 1, [1], b"\1")]
    header = 12 + 2 + 4 + sum(2 + len(name) + 2 + 1 + 8 + 8 * len(shape) for name, _, shape, _ in fields)
    entries, data = b"", b""
    for name, kind, shape, content in fields:
        entries += struct.pack("<H", len(name)) + name.encode() + struct.pack("<HBQ", len(shape), kind, header + len(data))
        entries += struct.pack(f"<{len(shape)}Q", *shape)
        data += content
    return b"tensor_file\0" + bytes([1, 0]) + struct.pack("<I", len(fields)) + entries + data


def exr(channels, compression, window=(0, 0, 2, 1), display=(0, 0, 2, 1), tiled=False, ranges=b"", more=b""):
    """An OpenEXR file whose pixels are not compressed, which is valid for every method: it then saves nothing.

    channels: pairs of name and pixel type (0: integers, 1: half, 2: float). ranges: of samples, as in merged pictures.
    more: the bytes of further attributes."""

    def attribute(name, kind, value):
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<I", len(value)) + value

    listed = b"".join(name.encode() + b"\0" + struct.pack("<iIii", kind, 0, 1, 1) for name, kind in channels) + b"\0"
    header = attribute("channels", "chlist", listed) + attribute("compression", "compression", bytes([compression]))
    header += attribute("dataWindow", "box2i", struct.pack("<4i", *window)) + attribute("displayWindow", "box2i", struct.pack("<4i", *display))
    header += attribute("lineOrder", "lineOrder", b"\0") + attribute("pixelAspectRatio", "float", struct.pack("<f", 1))
    header += attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)) + attribute("screenWindowWidth", "float", struct.pack("<f", 1))
    header += attribute("renderer", "string", b"fuzz") + attribute("seed", "double", struct.pack("<d", 1))
    if ranges:
        header += attribute("samples", "double", struct.pack("<d", 8)) + attribute("sampleRanges", "string", ranges)
    if tiled:
        header += attribute("tiles", "tiledesc", struct.pack("<IIB", 4, 2, 0))
    header += more
    width, height = window[2] - window[0] + 1, window[3] - window[1] + 1
    lines = [1, 1, 1, 16, 32, 16, 32, 32, 32, 256][compression]
    rows = height if tiled else min(height, lines)
    pixels = b"".join(struct.pack(["<I", "<H", "<f"][kind], [7, 0x3800, 0.5][kind]) * width for _, kind in channels)
    place = struct.pack("<4i", 0, 0, 0, 0) if tiled else None
    chunks = [(place or struct.pack("<i", y)) + struct.pack("<i", rows * len(pixels)) + rows * pixels for y in range(window[1], window[3] + 1, rows)]
    head = struct.pack("<II", 20000630, 2 | (0x200 if tiled else 0)) + header + b"\0"
    starts = [len(head) + 8 * len(chunks) + sum(map(len, chunks[:i])) for i in range(len(chunks))]
    return head + struct.pack(f"<{len(starts)}Q", *starts) + b"".join(chunks)


def exr_files():
    rgb = [("B", 1), ("G", 1), ("R", 1)]
    files = {f"compression-{method}": exr(rgb, method) for method in range(10)}
    files["alpha"] = exr([("A", 2), ("B", 2), ("G", 2), ("R", 2)], 0)
    files["grey"] = exr([("Y", 1)], 0)
    files["integers"] = exr([("Y", 0)], 0)
    files["cropped"] = exr(rgb, 0, window=(1, -1, 3, 0), display=(0, 0, 4, 4))
    files["tiled"] = exr(rgb, 0, tiled=True)
    files["merged"] = exr(rgb, 0, ranges=b"guided 1 0 4, path 1 8 12")
    # Attributes whose sizes are over that of the file.
    files["large-preview"] = exr(rgb, 0, more=b"preview\0preview\0" + struct.pack("<III", 8 + 4 * 23000**2, 23000, 23000))
    files["large-string"] = exr(rgb, 0, more=b"xpreview\0string\0" + struct.pack("<I", 0x7FFFFFFF))
    return files


def png(depth, colours, interlaced, rows, chunks=()):
    """rows: each begins with the number of its filter; chunks: pairs of name and data, between header and pixels."""
    header = struct.pack(">IIBBBBB", 3, 3, depth, colours, 0, 0, interlaced)
    listed = [(b"IHDR", header), *chunks, (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
                                            for name, data in listed)


def png_files():
    palette = [(b"PLTE", bytes(range(9))), (b"tRNS", b"\x40")]
    return {"palette": png(2, 3, 0, b"\0\x18\2\x20\4\x44", palette),
            "16-bit-interlaced": png(16, 4, 1, b"".join(b"\0" + bytes(range(4 * n)) for n in (1, 1, 2, 1, 1, 3)))}


def tga():
    return bytes([0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0]) + struct.pack("<HH", 2, 2) + bytes([24, 0]) + bytes(range(12))


def bmp():
    rows = bytes(range(6)) + b"\0\0"
    return b"BM" + struct.pack("<IHHI", 54 + 2 * len(rows), 0, 0, 54) + struct.pack("<IiiHHIIiiII", 40, 2, 2, 1, 24, 0, 0, 0, 0, 0, 0) + 2 * rows


def hdr():
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 2\n" + bytes([128, 64, 32, 129] * 4)


def jpeg():
    """The smallest grey baseline image: 8×8 pixels."""
    return bytes.fromhex("ffd8ffdb004300" + "03" * 64 + "ffc0000b080008000801011100" + "ffc40014000100000000000000000000000000000003"
                         "ffc400141001000000000000000000000000000000000" + "0ffda0008010100003f0047ffd9")


def run(*command):
    subprocess.run([str(part) for part in command], check=True, capture_output=True)


def made_by_tools(tools, work):
    scene = work / "scene.xml"
    scene.write_text(SCENE)
    run(tools / "lobefit", scene, "-o", work / "lobes")
    run(tools / "loberender", scene, "--cache", work / "lobes", "--integrator", "product", "--spp", "1", "--passes", "1", "--photons", "500",
        "--importons", "500", "--aov", "all", "-o", work / "a.exr", "-o", work / "a.png", "--save-illumination", work / "a.illum",
        "--checkpoint", work / "a.ckpt")
    caches = list((work / "lobes").glob("*.lobe"))
    return {"lobe": caches, "lobe-payload": caches, "illum": [work / "a.illum"], "illum-payload": [work / "a.illum"],
            "checkpoint": [work / "a.ckpt"], "checkpoint-payload": [work / "a.ckpt"], "exr": [work / "a.exr"], "png": [work / "a.png"],
            "xml": [scene]}


def main():
    tools, corpus = map(pathlib.Path, sys.argv[1:3])
    inline = {"obj": OBJ.encode(), "mtl": MTL.encode(), "obj-mtl": (OBJ + MTL).encode(), "ply": PLY.encode(), "serialized": serialized(1),
              "spd": b"# nm\n400 0.2\n500.5 0.4\n700 0.1\n", "rgl": tensor_file(),
              "merl": struct.pack("<3i4d", 90, 90, 180, 0, 30, 500, -1), "tga": tga(), "bmp": bmp(), "hdr": hdr(), "jpg": jpeg()}
    for target, content in inline.items():
        (corpus / target).mkdir(parents=True, exist_ok=True)
        (corpus / target / "initial").write_bytes(content)
    for target, files in {"exr": exr_files(), "png": png_files(), "serialized": {"two": serialized(2)}}.items():
        (corpus / target).mkdir(exist_ok=True)
        for name, content in files.items():
            (corpus / target / f"initial-{name}").write_bytes(content)
    with tempfile.TemporaryDirectory() as folder:
        for target, files in made_by_tools(tools, pathlib.Path(folder)).items():
            (corpus / target).mkdir(parents=True, exist_ok=True)
            for file in files:
                shutil.copy(file, corpus / target / f"initial-{file.name}")
    # Larger scenes take seconds with the sanitizers, in which hundreds of small ones are read.
    small = [file for file in ROOT.glob("scenes/*.xml") if file.stat().st_size < 5000]
    for file in [*ROOT.glob("tests/data/*"), *small]:
        for target in {".lobe": ["lobe", "lobe-payload"], ".illum": ["illum", "illum-payload"], ".xml": ["xml"]}.get(file.suffix, []):
            shutil.copy(file, corpus / target)


if __name__ == "__main__":
    main()
