// Bits of the second word of a splat that is named by a draw list, see `abi::SplatId`.
const uint LEAF = 1u << 31;
const uint OF_OWN_SIZE = 1u << 30;
const uint IN_PLANE = 1u << 29;
