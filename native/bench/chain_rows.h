/// What stands before and after skinning: shape keys, smoothing, hooks.
#pragma once

namespace sinew::bench {

/// Registers rows named "chain|what|vertices|threads|steps", each with one "chain bound|...", which
/// moves the same bytes and computes nothing.
void add_chain_rows(int cores);

}  // namespace sinew::bench
