#include "host/frame_shape.h"

#include <bit>
#include <cstring>
#include <type_traits>

namespace sinew::bindings {
namespace {

/// Two products of 64 bits with different factors, each of all that was added so far.
class Mixer {
 public:
  template <class T>
  void add(const T& value) {
    static_assert(std::is_arithmetic_v<T> || std::is_enum_v<T>);
    std::uint64_t word = 0;
    std::memcpy(&word, &value, sizeof value);
    mix(word);
  }

  /// count: of numbers.
  void add_numbers(const float* numbers, std::size_t count) {
    add(count);
    for (; count >= 2; count -= 2, numbers += 2) {
      std::uint64_t word;
      std::memcpy(&word, numbers, sizeof word);
      mix(word);
    }
    if (count > 0) add(*numbers);
  }

  template <class Matrix>
  void add_matrix(const Matrix& matrix) {
    for (Eigen::Index column = 0; column < matrix.cols(); ++column) {
      for (Eigen::Index row = 0; row < matrix.rows(); ++row) add(matrix(row, column));
    }
  }

  Digest digest() const { return {final_of(low_), final_of(high_)}; }

 private:
  void mix(std::uint64_t word) {
    low_ = std::rotl((low_ ^ word) * 0x9E3779B97F4A7C15u, 29);
    high_ = std::rotl((high_ + word) * 0xC2B2AE3D27D4EB4Fu, 31) ^ word;
  }

  static std::uint64_t final_of(std::uint64_t word) {
    word = (word ^ (word >> 33)) * 0xFF51AFD7ED558CCDu;
    word = (word ^ (word >> 33)) * 0xC4CEB9FE1A85EC53u;
    return word ^ (word >> 33);
  }

  std::uint64_t low_ = 0x243F6A8885A308D3u, high_ = 0x13198A2E03707344u;
};

void add_poses(Mixer& mixer, std::span<const LayerPose> poses) {
  for (const LayerPose& pose : poses) {
    const MatrixStack<const float>& stack = pose.matrices;
    mixer.add(stack.joints);
    if (stack.is_packed() && stack.joint_stride == 16) {
      mixer.add_numbers(stack.data, static_cast<std::size_t>(16 * stack.joints));
    } else {
      mixer.add(static_cast<std::size_t>(16 * stack.joints));
      for (std::ptrdiff_t j = 0; j < stack.joints; ++j) {
        const Matrix4<float> matrix = stack.at(0, j);
        for (int i = 0; i < 16; i += 2) {
          std::uint64_t word;
          std::memcpy(&word, matrix.data() + i, sizeof word);
          mixer.add(word);
        }
      }
    }
    mixer.add(pose.mesh_from_armature.has_value());
    if (pose.mesh_from_armature) mixer.add_matrix(*pose.mesh_from_armature);
  }
}

void add_settings(Mixer& mixer, const CorrectiveSmooth::Settings& settings) {
  mixer.add(settings.factor);
  mixer.add(settings.iterations);
  mixer.add(settings.scale);
  mixer.add(settings.type);
  mixer.add(settings.only_smooth);
}

void add_settings(Mixer& mixer, const Smooth::Settings& settings) {
  mixer.add(settings.factor);
  mixer.add(settings.iterations);
  for (const bool each : {settings.x, settings.y, settings.z}) mixer.add(each);
}

void add_settings(Mixer& mixer, const Hook::Settings& settings) {
  mixer.add_matrix(settings.matrix);
  mixer.add(settings.strength);
  mixer.add(settings.falloff);
  mixer.add(settings.radius);
  mixer.add_matrix(settings.center);
  mixer.add(settings.uniform.has_value());
  if (settings.uniform) mixer.add_matrix(*settings.uniform);
}

void add_settings(Mixer& mixer, const MixedLayers::Settings& settings) { add_poses(mixer, settings.poses); }

}  // namespace

std::optional<Digest> digest_of(std::uint64_t identity, std::span<const LayerPose> poses,
                                std::span<const float> key_values, std::span<const Stage> stages) {
  Mixer mixer;
  mixer.add(identity);
  mixer.add(poses.size());
  add_poses(mixer, poses);
  if (!key_values.empty()) mixer.add_numbers(key_values.data() + 1, key_values.size() - 1);
  bool is_complete = true;
  for (const Stage& stage : stages) {
    mixer.add(stage.index());
    std::visit(
        [&]<class Kind>(const Staged<Kind>& one) {
          if constexpr (requires { add_settings(mixer, one.settings); }) {
            add_settings(mixer, one.settings);
          } else {
            is_complete = false;
          }
        },
        stage);
  }
  return is_complete ? std::optional(mixer.digest()) : std::nullopt;
}

FrameShape::FrameShape(const Digest& own, std::span<const float> given)
    : digest(own), count(given.size()), positions(new float[given.size()]) {
  if (!given.empty()) std::memcpy(positions.get(), given.data(), given.size_bytes());
}

}  // namespace sinew::bindings
