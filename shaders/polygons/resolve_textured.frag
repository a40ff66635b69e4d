#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#define HAS_TEXTURES
#include "common/nearest_polygon.glsl"
