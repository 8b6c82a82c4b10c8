// The limit on the size of all meshes of a scene.

#include <filesystem>
#include <string>

#include <catch2/catch.hpp>

#include "scenes/meshes/mesh_budget.h"
#include "tests/support/tool_run.h"

namespace lobe {

TEST_CASE("meshes: few triangles and vertices are within the limit of a scene whatever the files") {
  MeshBudget budget;
  budget.addMesh(50000000, (1 << 26) - 50000000);
  CHECK(!budget.isExceeded());
  budget.addMesh(1, 0);
  CHECK(budget.isExceeded());
  CHECK(budget.fault() ==
        "the meshes of the scene have more than 67108864 triangles and vertices together, the limit for 0 bytes of "
        "mesh files");
}

TEST_CASE("meshes: the limit of a scene follows the bytes of its distinct files") {
  const test::Folder folder;
  folder.write("a.ply", std::string(4000000, 'a'));
  std::filesystem::create_symlink("a.ply", folder / "link.ply");
  MeshBudget budget;
  for (const std::string name : {"none.ply", "link.ply", "a.ply", "./a.ply", "a.ply"}) budget.addFile(folder / name);
  budget.addFile(folder.path().string() + "//a.ply");
  budget.addMesh(80000000, 0);
  CHECK(!budget.isExceeded());
  budget.addMesh(0, 1);
  CHECK_THAT(budget.fault(), Catch::Contains("more than 80000000 ") && Catch::Contains(" 4000000 bytes"));
  CHECK(budget.isExceeded());
  budget.addFile(folder.write("b.ply", "b"));
  CHECK(!budget.isExceeded());
}

}  // namespace lobe
