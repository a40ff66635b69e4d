// Unit vector from its octahedral code in -1..1 (Cigolle et al. 2014); the same steps as `math::octahedral`.
vec3 octahedral_decode(vec2 code) {
    vec3 v = vec3(code, 1.0 - abs(code.x) - abs(code.y));
    float fold = max(-v.z, 0.0);
    v.x -= v.x >= 0.0 ? fold : -fold;
    v.y -= v.y >= 0.0 ? fold : -fold;
    return normalize(v);
}
