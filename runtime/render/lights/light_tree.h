#pragma once
// A binary tree over lights at finite distance, in which a light is found by its expected contribution to a point
// (Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting").

#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "runtime/core/vec.h"

namespace lobe {

/// The place at which light is received.
struct LightReceiver {
  Vec3 position;
  Vec3 normal;  ///< unit, on the side that receives light; zero if both sides do
};

/// Where a light, or a group of lights, is and whereto it shines.
struct LightBounds {
  Eigen::AlignedBox3f box;
  Vec3 axis = Vec3::UnitZ();  ///< unit; of a cone that contains the normals of all surfaces
  float normalCosine = -1;    ///< of the half angle of that cone; −1: all directions
  float emissionCosine = 0;   ///< of the largest angle from a normal at which light leaves, at most π/2
  double power = 0;
};

/// Bounds of both.
LightBounds merged(const LightBounds& a, const LightBounds& b);

class LightTree {
 public:
  static constexpr int kRoot = 0;

  LightTree() = default;
  /// Lights keep their numbers. Lights without power are left out.
  explicit LightTree(const std::vector<LightBounds>& lights);

  bool empty() const { return nodes_.empty(); }
  /// The two nodes below a node; nullopt: it is a single light.
  std::optional<std::pair<int, int>> children(int node) const;
  /// Power, as a fraction of the power of all lights, and radius of a sphere around the lights of a node.
  float power(int node) const { return nodes_[node].power; }
  float radius(int node) const;
  /// The lights of a node.
  std::vector<int> lightsOf(int node) const;

  /// Estimate of the irradiance that a node causes without occlusion; 0 only if it causes none. Proportional to the
  /// irradiance, with the same factor for all nodes.
  float importance(int node, const LightReceiver& at) const;

  struct Choice {
    int light;
    float probability;
  };
  /// Chooses a light below a node; choice uniform in [0,1), rescaled to be uniform again. nullopt: no light of the node
  /// reaches the receiver.
  std::optional<Choice> sample(int node, const LightReceiver& at, double& choice) const;
  /// The probability of that choice for a light below the node.
  float probability(int node, const LightReceiver& at, int light) const;

 private:
  struct Node {
    Vec3 centre;
    float radius2;  // of the sphere around the box
    Vec3 axis;
    float normalCosine, emissionCosine;
    float power;
    int parent;
    int right;  // the left child follows the node; 0: a light
    int light;
  };

  int build(const std::vector<LightBounds>& lights, std::vector<int>::iterator first, std::vector<int>::iterator last,
            int parent);
  /// Of the left child, from the importance of both children.
  float leftProbability(int node, float left, float right) const;

  std::vector<Node> nodes_;
  std::vector<int> leafOf_;  // by light; −1: without power
  double total_ = 0;
};

}  // namespace lobe
