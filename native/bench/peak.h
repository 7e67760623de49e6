/// What the machine's multiply-add units can do.
#pragma once

namespace sinew::bench {

/// Runs multiply-adds of full registers in the best instruction set of the machine, nothing else,
/// for some milliseconds. Returns lanes x multiply-adds a second, the best of a few tries.
double multiply_adds_a_second();

}  // namespace sinew::bench
