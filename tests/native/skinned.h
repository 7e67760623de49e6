/// A skin in its poses, by any of the library's methods.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <span>
#include <vector>

#include "rigs.h"
#include "sinew/skinning.h"

namespace sinew::rigs {

using SkinFunction = void (*)(const Skin&, MatrixStack<const float>, std::span<float>);

/// Vertices of 0, 0.25 ... 1 side by side, and whole blocks of 0 and of 1.
std::vector<float> mixed_shares(std::ptrdiff_t vertices);

void skin_mixed(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions);

/// Somewhere in the box for most of the vertices that something moves.
RotationCenters random_centers(const Skin& skin);

void skin_about_centers(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions);

/// Without faces: each vertex follows its own joints alone.
std::shared_ptr<const DirectDeltaMush> mush_of(const Skin& skin);

void skin_mushed(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions);

/// For a layer of that method.
std::shared_ptr<const MethodData> data_of(SkinningMethod method, const Skin& skin);

/// V x 3, rows of what is no number where a vertex has none.
Eigen::MatrixX3d points_of(const RotationCenters& centers);

/// F x V x 3; and nothing is written beyond the end, whatever is left of the last block.
std::vector<float> skinned(SkinFunction skin_by, const Skin& skin, const Matrices& matrices, std::ptrdiff_t frames = 1,
                           Layout layout = Layout::column_major);

}  // namespace sinew::rigs
