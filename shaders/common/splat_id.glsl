// Bits of the second word of a splat that is named by a draw list, see `abi::SplatId`.
const uint LEAF = 1u << 31;
const uint OF_OWN_SIZE = 1u << 30;
const uint IN_PLANE = 1u << 29;
// Of filtered splats that are pieces of a triangle: where the number of times that its edges are halved, plus one, begins, the
// bits of that, and those of the piece.
const uint PIECE_CUTS = 26u;
const uint PIECE_MOST = 15u;
const uint PIECE_NUMBER = 0x3ffffffu;
