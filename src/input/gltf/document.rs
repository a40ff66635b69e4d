//! The description of a glTF file: the parts of its JSON that are read (Khronos, "glTF 2.0 Specification", 2021).

use serde::Deserialize;
use serde_json::Value;

/// The whole description.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct GltfDocument {
    pub(super) asset: GltfAsset,
    pub(super) scene: Option<usize>,
    pub(super) scenes: Vec<GltfScene>,
    pub(super) nodes: Vec<GltfNode>,
    pub(super) meshes: Vec<GltfMesh>,
    pub(super) accessors: Vec<GltfAccessor>,
    pub(super) buffer_views: Vec<GltfBufferView>,
    pub(super) buffers: Vec<GltfBuffer>,
    pub(super) materials: Vec<GltfMaterial>,
    pub(super) textures: Vec<Value>,
    pub(super) images: Vec<GltfImage>,
    pub(super) samplers: Vec<Value>,
    pub(super) animations: Vec<Value>,
    pub(super) skins: Vec<Value>,
    pub(super) cameras: Vec<Value>,
    pub(super) extensions_used: Vec<String>,
    pub(super) extensions_required: Vec<String>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct GltfAsset {
    pub(super) version: String,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct GltfScene {
    pub(super) nodes: Vec<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct GltfNode {
    pub(super) children: Vec<usize>,
    pub(super) mesh: Option<usize>,
    pub(super) skin: Option<usize>,
    pub(super) matrix: Option<[f64; 16]>,
    pub(super) translation: Option<[f64; 3]>,
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) extensions: Value,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct GltfMesh {
    pub(super) name: String,
    pub(super) primitives: Vec<GltfPrimitive>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct GltfPrimitive {
    pub(super) attributes: GltfAttributes,
    pub(super) indices: Option<usize>,
    pub(super) material: Option<usize>,
    pub(super) mode: Option<u32>,
    pub(super) targets: Vec<Value>,
    pub(super) extensions: Value,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE", default)]
pub(super) struct GltfAttributes {
    pub(super) position: Option<usize>,
    pub(super) normal: Option<usize>,
    #[serde(rename = "COLOR_0")]
    pub(super) color: Option<usize>,
    #[serde(flatten)]
    pub(super) others: serde_json::Map<String, Value>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct GltfAccessor {
    pub(super) buffer_view: Option<usize>,
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
    pub(super) normalized: bool,
    pub(super) count: u64,
    #[serde(rename = "type")]
    pub(super) shape: String,
    pub(super) sparse: Option<GltfSparse>,
}

/// Values that differ from those of the accessor.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct GltfSparse {
    pub(super) count: u64,
    pub(super) indices: GltfSparsePart,
    pub(super) values: GltfSparsePart,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct GltfSparsePart {
    pub(super) buffer_view: usize,
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct GltfBufferView {
    pub(super) buffer: usize,
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    pub(super) byte_stride: Option<u64>,
    pub(super) extensions: Value,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct GltfBuffer {
    pub(super) uri: Option<String>,
    pub(super) byte_length: u64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct GltfMaterial {
    pub(super) name: String,
    pub(super) pbr_metallic_roughness: GltfSurface,
    pub(super) alpha_mode: String,
    pub(super) extensions: Value,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct GltfSurface {
    pub(super) base_color_factor: Option<[f64; 4]>,
    pub(super) base_color_texture: Option<Value>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct GltfImage {
    pub(super) name: String,
    pub(super) uri: Option<String>,
    pub(super) mime_type: String,
    pub(super) buffer_view: Option<usize>,
}

impl GltfImage {
    /// A name for messages: of its file, its own, or its number.
    pub(super) fn shown_name(&self, index: usize) -> String {
        let uri = self.uri.as_deref().filter(|uri| !uri.starts_with("data:"));
        match uri.unwrap_or(&self.name) {
            "" => format!("number {index}"),
            name => name.to_owned(),
        }
    }
}
