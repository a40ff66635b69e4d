//! Leaf pages of triangles: vertices on a 16-bit grid, corners by indices of as few bits as the page's vertices need.
//!
//! Places are multiples of a power of two of model space, so that a vertex of several pages is at the same place in all of
//! them, and a surface without cracks stays one. Spheres, cones, splat radii and thickness are those of the triangles as
//! they are decoded.

use super::leaf_spheres::{self, leaf_of};
use super::nodes::{self, ColorSums, NO_NORMAL, NodeWord, normal_of};
use super::{
    ColorBits, DecodedPage, EncodedPage, LEAF_HEADER, LeafPageHeader, PageChoices, PageFault,
    PageSections, flag, grown, in_model_space, kind,
};
use crate::abi::Vertex;
use crate::math::octahedral;
use crate::pages::bits;
use crate::pages::quantize::{
    PageSphere, color_from_565, color_to_565, cone_code, decode_normal, encode_normal,
    packed_normals,
};
use crate::tree::{Leaf, Model, Node, NodeStrip, Tree, geometric_normal};
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// Bytes of a capsule.
const STRIP: usize = 4;

pub(super) fn encode(part: &Model, choices: PageChoices) -> EncodedPage {
    let (tree, base, step) = (&part.tree, choices.base, choices.step);
    let places: Vec<[u16; 3]> = part
        .vertices
        .iter()
        .map(|vertex| {
            let place = ((vertex.position.as_dvec3() - base) / step).round();
            place.to_array().map(|c| c.clamp(0.0, 65535.0) as u16)
        })
        .collect();
    let positions: Vec<Vec3> = places
        .iter()
        .map(|&place| position(place, step as f32))
        .collect();
    let corners: Vec<[Vec3; 3]> = (part.triangles.iter())
        .map(|triangle| triangle.map(|index| positions[index as usize]))
        .collect();
    let leaves: Vec<Leaf> = corners.iter().map(|&own| leaf_of(own)).collect();
    // Every node looks at all that is below it: normals are made once.
    let normals: Vec<DVec3> = (corners.iter())
        .map(|&own| geometric_normal(own).0)
        .collect();
    let (spheres, root) = grown(tree, &leaves, base);
    let (codes, decoded) = nodes::encode_spheres(tree, &spheres, root);

    let mut node_bytes = Vec::new();
    let (mut radii, mut thickness) = (Vec::new(), Vec::new());
    let mut strips = Vec::new();
    for (id, node) in tree.nodes.iter().enumerate() {
        let range = tree.leaf_range(id as u32);
        let range = range.start as usize..range.end as usize;
        let below = PageTriangles {
            corners: &corners[range.clone()],
            normals: &normals[range],
            sphere: decoded[id],
        };
        let normal = nodes::normal_code(&tree.attributes[id]);
        let cone = below.cone(normal, node);
        node_bytes.extend(
            NodeWord::new(codes[id], node.child_count, normal, cone)
                .0
                .to_le_bytes(),
        );
        let radius_code = below.radius_code();
        radii.push(radius_code);
        thickness.push(below.thickness_code(normal, splat_radius(&decoded[id], radius_code)));
        strips.push(below.strip(node));
    }
    let has_strips = strips.iter().any(|strip| *strip != NodeStrip::SPHERE);
    let colors = match (part.has_colors, choices.colors) {
        (false, _) => 0,
        (true, ColorBits::Few) => flag::FEW_COLORS,
        (true, ColorBits::All) => flag::ALL_COLORS,
    };
    let header = LeafPageHeader {
        kind: kind::TRIANGLES,
        flags: colors
            | if has_strips { flag::STRIPS } else { 0 }
            | if part.patches.is_some() {
                flag::PATCHES
            } else {
                0
            },
        leaf_count: leaves.len() as u32,
        vertex_count: places.len() as u32,
        node_count: tree.nodes.len() as u32,
        level_count: tree.level_count() as u32,
        sphere: root,
        base: base.to_array(),
        step,
    };
    let mut bytes = bytemuck::bytes_of(&header).to_vec();
    bytes.extend(node_bytes);
    bytes.extend(radii);
    bytes.extend(thickness);
    if has_strips {
        let is_thin = |strip: &NodeStrip| *strip != NodeStrip::SPHERE;
        bits::pack(strips.iter().map(|s| u32::from(is_thin(s))), 1, &mut bytes);
        for strip in strips.iter().filter(|s| is_thin(s)) {
            bytes.extend(bytemuck::bytes_of(strip));
        }
    }
    for place in &places {
        place.iter().for_each(|c| bytes.extend(c.to_le_bytes()));
    }
    for vertex in &part.vertices {
        let code = match vertex.color[3] {
            0 => NO_NORMAL,
            _ => encode_normal(octahedral::decode(vertex.normal)),
        };
        bytes.extend(code.to_le_bytes());
    }
    for vertex in part.vertices.iter().filter(|_| part.has_colors) {
        let [r, g, b, _] = vertex.color;
        match choices.colors {
            ColorBits::Few => bytes.extend(color_to_565([r, g, b]).to_le_bytes()),
            ColorBits::All => bytes.extend([r, g, b]),
        }
    }
    let indices = part.triangles.iter().flatten().copied();
    bits::pack(indices, bits::bits_below(places.len()), &mut bytes);
    if let Some(patches) = &part.patches {
        let recorded = 0..recorded_nodes(tree) as u32;
        patches.of_nodes(recorded).append_to(&mut bytes);
    }
    EncodedPage {
        bytes,
        root: in_model_space(root, base),
    }
}

/// Number of nodes with records of patches: all but those of the last level. Their triangles are a few, and as exact.
pub(in crate::pages) fn recorded_nodes(tree: &Tree) -> usize {
    match *tree.level_starts.as_slice() {
        [.., last, _] => last as usize,
        _ => 0,
    }
}

#[inline(always)]
fn position(place: [u16; 3], step: f32) -> Vec3 {
    let [x, y, z] = place.map(f32::from);
    Vec3::new(x, y, z) * step
}

/// Radius of a node's splat by its code.
#[inline(always)]
fn splat_radius(sphere: &PageSphere, code: u8) -> f32 {
    sphere.radius * (f32::from(code) * (1.0 / 255.0))
}

/// The triangles below a node, and its decoded sphere.
struct PageTriangles<'a> {
    corners: &'a [[Vec3; 3]],
    /// Unit normals, zero where there is none.
    normals: &'a [DVec3],
    sphere: PageSphere,
}

impl PageTriangles<'_> {
    /// The code of the cone of all normals, and the special bit.
    fn cone(&self, normal: u16, node: &Node) -> (u8, bool) {
        let axis = decode_normal(normal).as_dvec3();
        let (mut square, mut any, mut is_wide) = (0.0f64, false, false);
        for &own in self.normals {
            if own == DVec3::ZERO {
                continue;
            }
            any = true;
            is_wide |= own.dot(axis) <= 0.0;
            square = square.max(own.cross(axis).length_squared());
        }
        if !any {
            return (0, true);
        }
        let sine = if is_wide { 1.0 } else { square.sqrt() + 1e-6 };
        if node.flags & Node::UNCULLED != 0 || normal == NO_NORMAL {
            return (3, node.flags & Node::UNCULLED != 0);
        }
        (cone_code(sine), false)
    }

    fn each(&self) -> impl Iterator<Item = Vec3> {
        self.corners
            .iter()
            .flatten()
            .map(|&p| p - self.sphere.center)
    }

    /// The least radius that reaches all corners.
    fn radius_code(&self) -> u8 {
        let squares = self.each().map(|v| v.length_squared());
        let most = squares.fold(0.0, f32::max).sqrt() * (1.0 + 1e-6);
        // The cast saturates. Two below are too small for sure.
        let first = (most / self.sphere.radius * 255.0 - 2.0) as u8;
        (first..255)
            .find(|&code| splat_radius(&self.sphere, code) >= most)
            .unwrap_or(255)
    }

    /// Half the thickness along the normal, in 254ths of the splat's radius.
    fn thickness_code(&self, normal: u16, radius: f32) -> u8 {
        if normal == NO_NORMAL || radius == 0.0 {
            return 254;
        }
        let along = decode_normal(normal);
        let most = self.each().map(|v| v.dot(along).abs()).fold(0.0, f32::max);
        ((most / radius * (1.0 + 1e-6) * 254.0).ceil() as u8).min(254)
    }

    /// The capsule along the direction of the model's own, around the corners as they are decoded.
    fn strip(&self, node: &Node) -> NodeStrip {
        let radius = self.sphere.radius;
        if node.strip == NodeStrip::SPHERE || radius == 0.0 {
            return NodeStrip::SPHERE;
        }
        let direction = node.strip.direction();
        let parts = |v: Vec3| {
            let along = v.dot(direction);
            (along.abs(), (v - direction * along).length())
        };
        let width = self.each().map(|v| parts(v).1).fold(0.0, f32::max);
        let code = |length: f32| (length / radius * (1.0 + 1e-5) * 255.0).ceil() + 1.0;
        if code(width) >= 255.0 {
            return NodeStrip::SPHERE;
        }
        let beyond = |v: Vec3| {
            let (along, across) = parts(v);
            along - (width * width - across * across).max(0.0).sqrt()
        };
        let half = self.each().map(beyond).fold(0.0, f32::max);
        NodeStrip {
            half_length: code(half).min(255.0) as u8,
            width: code(width) as u8,
            ..node.strip
        }
    }
}

pub(super) fn decode(bytes: &[u8]) -> Result<DecodedPage, PageFault> {
    let header = LeafPageHeader::read(bytes)?;
    let (leaf_count, node_count) = (header.leaf_count as usize, header.node_count as usize);
    let vertex_count = header.vertex_count as usize;
    let step = header.step as f32;
    if !(step > 0.0 && f64::from(step) == header.step) {
        return Err((64, "a step that is none".to_owned()));
    }
    let mut sections = PageSections {
        bytes,
        at: LEAF_HEADER,
    };
    let words = sections.take(node_count * 4, "nodes")?;
    let radii = sections.take(node_count, "splat radii")?;
    let thickness = sections.take(node_count, "thicknesses")?;
    let strips = if header.flags & flag::STRIPS == 0 {
        (&[][..], &[][..])
    } else {
        let at = sections.at;
        let thin = sections.take(bits::packed_bytes(node_count, 1), "capsules")?;
        if !bits::is_filled_with_zeros(thin, node_count, 1) {
            return Err((at, "capsules of no node".to_owned()));
        }
        let count: usize = thin.iter().map(|byte| byte.count_ones() as usize).sum();
        (thin, sections.take(count * STRIP, "capsules")?)
    };
    let places = sections.take(vertex_count * 6, "vertices")?;
    let normals_at = sections.at;
    let normals = sections.take(vertex_count * 2, "normals")?;
    let colors = sections.take(vertex_count * header.color_bytes(), "colors")?;
    let index_bits = bits::bits_below(vertex_count);
    let indices_at = sections.at;
    let indices = sections.take(bits::packed_bytes(leaf_count * 3, index_bits), "corners")?;
    if !bits::is_filled_with_zeros(indices, leaf_count * 3, index_bits) {
        return Err((indices_at, "corners of no triangle".to_owned()));
    }
    let mut tree = nodes::decode_tree(
        words,
        header.sphere,
        (leaf_count, header.level_count as usize),
    )?;
    nodes::decode_cones(words, &mut tree);
    let patches = match header.flags & flag::PATCHES {
        0 => None,
        _ => Some(sections.patches(recorded_nodes(&tree), header.has_colors())?),
    };
    sections.end()?;

    if let Some(index) = codes(normals).position(|code| !nodes::is_normal(code)) {
        return Err((
            normals_at + index * 2,
            format!("vertex {index}: a normal that is none"),
        ));
    }
    let any_normal = codes(normals).any(|code| code != NO_NORMAL);
    let vertices = decode_vertices(places, normals, (colors, header.color_bytes()), step);
    let mut triangles = vec![[0u32; 3]; leaf_count];
    bits::unpack_triples(indices, index_bits, &mut triangles);
    // A loop of its own: as a vector, and without a guess about each number.
    let largest = triangles.as_flattened().iter().fold(0, |a, &b| a.max(b));
    if largest as usize >= vertex_count {
        let is_wrong = |own: &[u32; 3]| own.iter().any(|&index| index as usize >= vertex_count);
        let leaf = triangles.iter().position(is_wrong).unwrap_or(0);
        return Err((
            indices_at,
            format!("triangle {leaf}: a corner that is no vertex"),
        ));
    }
    let mut areas = vec![0.0; leaf_count];
    leaf_spheres::fill(&vertices, &triangles, &mut tree.leaves, &mut areas);
    fill_attributes(
        words,
        &mut tree,
        &vertices,
        &triangles,
        &areas,
        (header.has_colors(), any_normal),
    );
    let (thin, mut capsules) = strips;
    for id in 0..node_count {
        let sphere = PageSphere {
            center: tree.nodes[id].center,
            radius: tree.nodes[id].radius,
        };
        let own = &mut tree.attributes[id];
        own.splat_radius = splat_radius(&sphere, radii[id]).min(sphere.radius);
        if own.has_normal() {
            own.color[3] = 255 - thickness[id].min(254);
        }
        if bits::unpack(thin, 1, id) != 0
            && let Some((capsule, rest)) = capsules.split_first_chunk::<STRIP>()
        {
            tree.nodes[id].strip = bytemuck::pod_read_unaligned(capsule);
            capsules = rest;
        }
    }
    Ok(DecodedPage {
        model: Model {
            vertices,
            triangles,
            tree,
            has_colors: header.has_colors(),
            patches: patches.map(|own| Arc::new(own.filled(node_count))),
            ..Model::default()
        },
        base: DVec3::from_array(header.base),
        children: None,
    })
}

/// Numbers of two bytes.
fn codes(bytes: &[u8]) -> impl Iterator<Item = u16> {
    let (codes, _) = bytes.as_chunks::<2>();
    codes.iter().map(|code| u16::from_le_bytes(*code))
}

fn decode_vertices(
    places: &[u8],
    normals: &[u8],
    (colors, color_bytes): (&[u8], usize),
    step: f32,
) -> Vec<Vertex> {
    let table = packed_normals();
    let (places, _) = places.as_chunks::<6>();
    let mut vertices: Vec<Vertex> = (places.iter().zip(codes(normals)))
        .map(|(&[x0, x1, y0, y1, z0, z1], code)| {
            let normal = normal_of(table, code);
            Vertex {
                position: position([[x0, x1], [y0, y1], [z0, z1]].map(u16::from_le_bytes), step),
                normal: normal.unwrap_or_default(),
                color: [255, 255, 255, if normal.is_some() { 255 } else { 0 }],
            }
        })
        .collect();
    match color_bytes {
        0 => {}
        2 => {
            for (vertex, code) in vertices.iter_mut().zip(codes(colors)) {
                vertex.color[..3].copy_from_slice(&color_from_565(code));
            }
        }
        _ => {
            for (vertex, color) in vertices.iter_mut().zip(colors.as_chunks::<3>().0) {
                vertex.color[..3].copy_from_slice(color);
            }
        }
    }
    vertices
}

fn fill_attributes(
    words: &[u8],
    tree: &mut Tree,
    vertices: &[Vertex],
    triangles: &[[u32; 3]],
    areas: &[f32],
    (has_colors, any_normal): (bool, bool),
) {
    let mut sums = ColorSums {
        sums: vec![[0.0; 4]; if has_colors { tree.nodes.len() } else { 0 }],
        any_normal,
    };
    for id in 0..tree.nodes.len() {
        let node = &tree.nodes[id];
        if !node.has_leaves() {
            continue;
        }
        let first = node.first_child as usize;
        let below = first..first + usize::from(node.child_count);
        let mut area = 0.0;
        for (triangle, &own) in triangles[below.clone()].iter().zip(&areas[below]) {
            area += own;
            if has_colors {
                let [a, b, c] = triangle.map(|index| &vertices[index as usize]);
                let weight = own.max(1e-30);
                for k in 0..3 {
                    let color =
                        f32::from(a.color[k]) + f32::from(b.color[k]) + f32::from(c.color[k]);
                    sums.sums[id][k] += color * (1.0 / 3.0) * weight;
                }
                sums.sums[id][3] += weight;
            }
        }
        tree.attributes[id].area = area;
    }
    sums.fill(words, tree, has_colors);
}
