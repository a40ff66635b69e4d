// Frame flag: multiply the albedo by the vertex color.
const uint FLAG_USE_COLORS = 1u;
// Frame flag: light both sides of a surface.
const uint FLAG_TWO_SIDED = 2u;
// Frame flag: color by kind of primitive instead of by vertex color.
const uint FLAG_COLOR_BY_PRIMITIVE = 4u;
// Frame flag: parallel light along the view direction (also for every orthographic view).
const uint FLAG_PARALLEL_LIGHT = 8u;
// Frame flag: orthographic projection.
const uint FLAG_ORTHOGRAPHIC = 16u;
// Frame flag: what faces away is culled, so every normal that is seen counts as one that faces the eye.
const uint FLAG_CULLS_BACK = 32u;
// Frame flag: one lamp instead of the headlight.
const uint FLAG_PHONG = 64u;
// A surface shows its back to the eye where n . v is below minus this: an interpolated normal may turn away a little.
const float LEAST_BACK = 0.2;
// n . l from which a highlight has its full strength; at 0 it has none.
const float FULL_HIGHLIGHT = 0.1;
// Frame flag: visibility splats show the class of each pixel instead of its color.
const uint FLAG_COLOR_BY_CLASSIFICATION = 128u;
// Frame flag: levels of the tree as colors, without light.
const uint FLAG_COLOR_BY_LEVEL = 256u;
// Frame flag: normals as colors, without light.
const uint FLAG_COLOR_BY_NORMAL = 512u;
// Frame flag: depth as color, without light.
const uint FLAG_COLOR_BY_DEPTH = 1024u;
// Frame flag: lamps that go with the camera, and a material, instead of the headlight.
const uint FLAG_LIT_SPHERE = 2048u;
// Beside flags that a pipeline was made for: they are what the frame has.
const uint FLAGS_ARE_KNOWN = 0x80000000u;
// Diffuse albedo.
const float ALBEDO = 0.8;
// A pixel of fuzzy splats shows something when the sum of its weights is at least this.
const float LEAST_FUZZY_WEIGHT = 1e-4;
// How far from a pixel that lies between the rectangles of filtered splats its color is looked for in eight directions, pixels;
// and all around it, where that finds nothing.
const uint FILTERED_REACH_PX = 21u;
const uint FILTERED_AROUND_PX = 8u;
// A neighbor of a pixel of filtered splats is another part of the surface when its front lies farther by so many pixels' (or
// splats', if these are larger) width.
const float FILTERED_JUMP = 3.0;
// A pixel at a rim shows what is behind when filtered splats cover less of it than this: half a level.
const float LEAST_FILTERED_COVERAGE = 0.002;
// Depth offset of a filtered splat that is parallel to the picture, in half sides: its neighbors may not be.
const float OFFSET_OF_NEIGHBORS = 0.14285715;
// Depth offset of a triangle beside others of the angle that its corners have with it, in half sides over the sine.
const float OFFSET_OF_BEND = 2.0;
// Depth offset of the thickness of a patch, in half thicknesses.
const float OFFSET_OF_THICKNESS = 1.5;
// The least width of a filtered splat's rectangle.
const float LEAST_EXTENT_PX = 0.0625;
// How far below a node it is looked for how the color changes along its row.
const uint SLOPE_LEVELS = 4u;
// Fewest splats of a row along which the color changes. Shorter rows are many, and the eye does not tell.
const uint LEAST_SLOPED = 4u;
// Parts of a node nearer together than this, in its radii, tell nothing of a slope along it: the standard deviation of
// their places. The two triangles of a needle's strip lie at a sixth of its length to either side of the middle.
const float LEAST_SPREAD = 0.15;
// How much the color of a row may differ from its mean, in what its parts differ by. From 0.75 to 1.5 tori of needles
// change by a tenth of a decibel; this is the least FLIP.
const float MOST_CHANGE = 1.1;
// Cosine of the angle to the viewer of the flattest patch whose depth offset is its own: flatter ones are pushed as far. With
// 0.1 a plane lost its last two rows of pixels before the horizon to what lies before them.
const float LEAST_FILTERED_FACING = 0.02;
// The same of a triangle that is drawn as one large splat, whose neighbors may be anything: farther, it would hide nothing.
const float LEAST_FACING_OF_OWN = 0.1;
// Share of its area that a patch must show to be drawn: seen edge-on or from behind it covers nothing.
const float LEAST_FRONT = 1e-4;
// Where most triangles of a cut have at most this diameter in pixels, triangles are filtered splats: one sample a pixel says
// little of the area of such a triangle.
const float SMALL_PIECED_PX = 3.0;
// The share that must be small for that. A pixel of both kinds is less exact than one of either.
const float LEAST_SMALL_SHARE = 0.9;
// The largest triangles that are, then. Single larger ones would leave pixels of both kinds.
const float LARGEST_PIECED_PX = 6.0;
// Pieces of triangles have at most this diameter: edges are halved until they do, which makes four of each.
const float PIECE_PX = 1.5;
// Most times that they are in lists of numbers, see `abi::SplatId`.
const uint MOST_PIECE_CUTS = 13u;
// Farther from the picture than this, in pixels, nothing reaches into it.
const float FARTHEST_PX = 1e9;
// Compute draws blended splats up to this size, pixels; the rasterizer those that are larger.
const float LARGEST_SMALL_BLENDED_PX = 16.0;
// From so many splats and triangles in a pixel on, the heat map of overdraw has the color of the end of its ramp.
const float MOST_OVERDRAW = 64.0;
// Steps in a sum of 1 of small splats, coarse and fine. Sums below 65536 and below 64 fit.
const float COARSE_STEPS = 65536.0;
const float FINE_STEPS = 67108864.0;
// Weights from here on are coarse: 1024 steps, of which a half is far below a level.
const float LEAST_COARSE = 0.015625;
// More than this no deposit weighs, so that what is out of all bounds spoils no other pixel's sums.
const float MOST_WEIGHT = 1024.0;
// Photographs that a pass puts on the surface at most, and vectors that each takes in its block.
const uint MOST_FRAME_PHOTOS = 64u;
const uint PHOTO_VECTORS = 11u;
// Those that are weighed together.
const uint PHOTO_GROUP = 4u;
// Word of the counts of a cut on the device that is the number of quads.
const uint QUADS_WORD = 5u;
// A turn of the rectangle around a patch, radians: a 256th of a quarter turn.
const float PATCH_TURN = 0.0061359233;
// Half sides of a patch are packed in these, radii.
const float PATCH_SIDE_STEP = 1.5716792e-5;
// Lengths of a patch are packed as logarithms below this, radii.
const float LARGEST_PATCH_LENGTH = 1.01;
// 2 to the half, quarter, eighth and sixteenth.
const float ROOT_2 = 1.4142135;
const float ROOT_4 = 1.1892071;
const float ROOT_8 = 1.0905077;
const float ROOT_16 = 1.0442737;
// Rims of patches: widths of a pixel by which depths may be off a straight line. At one pixel more than twice as many pixels
// are sampled, and pictures are no nearer.
const float RIM_STRAIGHT_PX = 4.0;
// Part of a patch's margin that counts there: the surface lies within the thickness on both sides of its plane.
const float RIM_MARGIN = 0.5;
// Cosine of the angle with the way outward from which on a side of a patch bounds it there.
const float OUTWARD_COSINE = 0.3;
