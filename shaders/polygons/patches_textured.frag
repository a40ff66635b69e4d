#version 460
#define HAS_TEXTURES
#include "common/patch_seen.glsl"
