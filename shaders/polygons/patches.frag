#version 460
#include "common/patch_seen.glsl"
