#pragma once
// Groups requests for records by cubes of space, so that distant requests can be processed in parallel.

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "runtime/guiding/particle.h"

namespace lobe {

/// A grid of cubes, of which only those that contain requests are stored. Cubes of equal parity, that is, whose integer
/// coordinates differ by even numbers, do not touch: requests in different cubes of one parity are at least one edge
/// apart.
class RequestCubes {
 public:
  static constexpr int kParities = 8;

  /// edge: of a cube in world units, > 0. Only requests for which `counts` is true are grouped; it is called in
  /// parallel. requests must outlive this object.
  RequestCubes(std::span<const RecordRequest> requests, float edge,
               const std::function<bool(const RecordRequest&)>& counts);

  std::size_t size() const { return cubes_.size(); }
  /// The numbers of the cubes of a parity in [0, kParities).
  std::vector<std::size_t> ofParity(int parity) const;
  /// The indices of a cube's requests, in ascending order.
  std::span<const std::uint32_t> requests(std::size_t cube) const;
  /// The numbers of the cube itself and of the up to 26 cubes that touch it.
  std::vector<std::size_t> around(std::size_t cube) const;

 private:
  struct Cube {
    std::uint64_t key;
    std::size_t begin, end;
  };

  std::vector<Cube> cubes_;  // sorted by key
  std::vector<std::uint32_t> requests_;
};

}  // namespace lobe
