#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#include "common/nearest_polygon.glsl"
