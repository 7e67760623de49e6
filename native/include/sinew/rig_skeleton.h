/// The skeleton of a rig folder: .bf (bone forest) and .tgf (trivial graph format).
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "sinew/skeleton.h"

namespace sinew {

/// What a rotation turns and what a weight column belongs to.
enum class Convention {
  /// Row j stands for the edge parent(j) -> j and turns it about joint parent(j) (libigl). A .bf file
  /// in this convention has a root whose weight index is -1; a .tgf file is always in it.
  bone,
  /// Row j stands for joint j itself: it turns about its own position and moves its descendants.
  joint,
};

/// A Skeleton as the file describes it: rest transforms are translations, and each joint has a
/// segment to draw as a bone and possibly a column of weights.
class RigSkeleton : public Skeleton {
 public:
  /// heads           J x 3, world: where the joint turns, the translation of A(j).
  /// tails           J x 3, world: where its bone is drawn to. Equal to the head if unknown.
  /// weight_columns  J, the column of weights.dmat that belongs to the joint, or -1. No column may
  ///                 belong to two joints.
  /// names           J, unique; if empty, they are made from the joints' numbers.
  RigSkeleton(std::span<const std::int32_t> parents, const Eigen::MatrixX3d& heads, Eigen::MatrixX3d tails,
              std::vector<std::int32_t> weight_columns, std::vector<std::string> names, Convention convention);

  const Eigen::MatrixX3d& heads() const { return heads_; }
  const Eigen::MatrixX3d& tails() const { return tails_; }
  const std::vector<std::int32_t>& weight_columns() const { return weight_columns_; }
  const std::vector<std::string>& names() const { return names_; }
  Convention convention() const { return convention_; }

 private:
  Eigen::MatrixX3d heads_;
  Eigen::MatrixX3d tails_;
  std::vector<std::int32_t> weight_columns_;
  std::vector<std::string> names_;
  Convention convention_;
};

/// Reads .bf or .tgf, depending on the path's ending. `convention` overrides the one that a .bf file
/// indicates. Text after the fifth field of a .bf line is the joint's name, including spaces, unless
/// it is a number or a comment (#); names are used only if every joint has one and no two are equal.
/// Throws InputError with file and line for: a missing file, an unknown ending, an empty file, text
/// that is not a number, too few numbers, a parent or joint that does not exist, a cycle, two joints
/// with the same column.
RigSkeleton read_skeleton(const std::filesystem::path& path, std::optional<Convention> convention = std::nullopt);

/// Writes .bf or .tgf, depending on the path's ending, so that it reads back as the same skeleton:
/// positions to rounding, since .bf holds differences of them, and without the names for .tgf.
/// Throws InputError if the format cannot hold it: .tgf holds only the bone convention, and only if
/// every joint has a bone; .bf holds only the convention that its roots' weight columns indicate.
void write_skeleton(const std::filesystem::path& path, const RigSkeleton& skeleton);

}  // namespace sinew
