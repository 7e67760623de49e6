#include "sinew/blend_shares.h"

#include <algorithm>

#include "base/check.h"
#include "skinning/tile.h"

namespace sinew {

BlendShares::BlendShares(std::span<const float> shares)
    : vertex_count_(std::ssize(shares)), shares_(shares.begin(), shares.end()) {
  for (std::size_t v = 0; v < shares.size(); ++v) {
    if (!(shares[v] >= 0 && shares[v] <= 1)) {
      fail("the share of vertex ", grouped(static_cast<long long>(v)), " is ", shares[v], "; expected 0 to 1");
    }
  }
  const std::size_t blocks = (shares.size() + kBlock - 1) / kBlock;
  if (!shares.empty()) shares_.resize(blocks * kBlock, shares.back());
  for (std::size_t b = 0; b < blocks; ++b) {
    const auto [least, most] = std::minmax_element(of_block(b), of_block(b) + kBlock);
    methods_.push_back(*most == 0    ? SkinningMethod::linear
                       : *least == 1 ? SkinningMethod::dual_quaternion
                                     : SkinningMethod::blended);
  }
}

const float* BlendShares::of_block(std::size_t b) const { return shares_.data() + b * kBlock; }

}  // namespace sinew
