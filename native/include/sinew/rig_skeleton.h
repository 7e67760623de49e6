/// The skeleton of a rig folder: .bf (bone forest) and .tgf (trivial graph format).
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "sinew/skeleton.h"

namespace sinew {

/// What a rotation turns, and what a weight column belongs to.
enum class Convention {
  /// Row j stands for the edge parent(j) -> j and turns it about joint parent(j) (libigl). In a .bf
  /// file recognised by a root whose weight index is -1; a .tgf file is always in this convention.
  bone,
  /// Row j stands for joint j itself: it turns about its own position and carries what hangs on it.
  joint,
};

/// A Skeleton as the file describes it: rest transforms are translations, and each joint has a
/// segment to be drawn as a bone and, perhaps, a column of weights.
class RigSkeleton : public Skeleton {
 public:
  /// heads           J x 3, world: where the joint turns, the translation of A(j).
  /// tails           J x 3, world: where its bone is drawn to. Equal to the head if nothing says.
  /// weight_columns  J, the column of weights.dmat that belongs to the joint, or -1. No column may
  ///                 belong to two joints.
  /// names           J, unique; or none, and they are made from the joint's number.
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

/// Reads .bf or .tgf, by the path's ending. `convention` overrides what a .bf file says of itself.
/// Text after the fifth field of a .bf line is taken as the joint's name, blanks and all, unless it
/// is a number or a comment (#), and if every joint has one of its own.
/// Throws InputError with file and line for: no file, an unknown ending, an empty file, letters or
/// too few numbers, a parent or joint that does not exist, a cycle, two joints with one column.
RigSkeleton read_skeleton(const std::filesystem::path& path, std::optional<Convention> convention = std::nullopt);

/// Writes .bf or .tgf, by the path's ending, so that it reads back as the same skeleton: positions
/// to rounding, since .bf holds differences of them, and without the names in a .tgf file.
/// Throws InputError if the format cannot hold it: .tgf holds the bone convention alone, and only
/// if every joint has a bone; .bf, the convention that its roots' weight columns speak of.
void write_skeleton(const std::filesystem::path& path, const RigSkeleton& skeleton);

}  // namespace sinew
