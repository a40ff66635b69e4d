//! The tree of a scene on the device, for passes that look at nodes and leaves by their numbers.

use crate::abi::PatchTexture;
use crate::gpu::buffer::{AnyBuffer, BufferUsage, DeviceBuffer};
use crate::gpu::{Error, Gpu};
use crate::render::vulkan::scene::{DeviceScene, ScenePage};
use crate::tree::{Leaf, Model, Node, NodeAttributes, PatchRecords, SurfaceMoments};
use std::sync::Arc;

/// The tree of a scene on the device.
#[derive(Debug)]
pub(crate) struct DeviceTree {
    scene: u64,
    /// As [`Node`].
    pub(crate) nodes: DeviceBuffer,
    /// As [`NodeAttributes`].
    pub(crate) attributes: DeviceBuffer,
    /// As [`Leaf`].
    pub(crate) leaves: DeviceBuffer,
    /// Three numbers of vertices for each leaf of a mesh.
    pub(crate) corners: DeviceBuffer,
    /// Moments of the nodes ([`SurfaceMoments`]); `None` until filtered splats have asked for them.
    moments: Option<DeviceBuffer>,
    /// Records of patches; `None` until patches have asked for them.
    patches: Option<DevicePatches>,
}

/// Packed records of the patches of a tree.
#[derive(Debug)]
pub(crate) struct DevicePatches {
    /// Records, one a node ([`PackedPatch`](crate::tree::PackedPatch)).
    pub(crate) records: DeviceBuffer,
    /// Colors, one a node ([`PackedPatchColors`](crate::tree::PackedPatchColors)); `None` where the model has none.
    pub(crate) colors: Option<DeviceBuffer>,
    /// Places in images, one a node ([`PatchTexture`](crate::abi::PatchTexture)); `None` where the model has none.
    pub(crate) places: Option<DeviceBuffer>,
}

/// The tree of a scene, and the scene.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SceneTree<'a> {
    pub(crate) tree: &'a DeviceTree,
    pub(crate) scene: &'a DeviceScene,
}

/// Storage buffers that the passes over it bind at most: `cut.leaves` and `lists.splats`.
const MOST_BUFFERS: u32 = 7;

/// Storage buffers that `lists.filtered` binds.
const BUFFERS_WITH_MOMENTS: u32 = 8;

impl DeviceTree {
    /// Copies a tree to the device.
    ///
    /// # Errors
    /// When it does not fit, or a Vulkan call fails.
    pub(crate) fn new(gpu: &Arc<Gpu>, model: &Model, scene: &DeviceScene) -> Result<Self, Error> {
        let tree = &model.tree;
        let page = page_of(scene)?;
        if gpu.info().max_storage_buffers < MOST_BUFFERS {
            return Err(too_large(
                "the device binds too few storage buffers at once",
            ));
        }
        let (nodes, attributes): (&[Node], &[NodeAttributes]) = (&tree.nodes, &tree.attributes);
        let (leaves, corners): (&[Leaf], &[[u32; 3]]) = (&tree.leaves, page.corners(model));
        let all: [&[u8]; 4] = [
            bytemuck::cast_slice(nodes),
            bytemuck::cast_slice(attributes),
            bytemuck::cast_slice(leaves),
            bytemuck::cast_slice(corners),
        ];
        let bytes = all.map(|data| data.len() as u64);
        fits_bindings(gpu, bytes.into_iter().chain([page.vertices.bytes()]))?;
        fits_memory(gpu, bytes.into_iter().sum())?;
        let filled = |name: &str, data: &[u8]| filled(gpu, name, data);
        let [nodes, attributes, leaves, corners] = all;
        Ok(Self {
            scene: scene.id(),
            nodes: filled("nodes", nodes)?,
            attributes: filled("attributes of nodes", attributes)?,
            leaves: filled("leaves", leaves)?,
            corners: filled("corners", corners)?,
            moments: None,
            patches: None,
        })
    }

    /// Copies what filtered splats are made of besides, unless it is there.
    ///
    /// # Errors
    /// When it does not fit, or a Vulkan call fails.
    pub(crate) fn add_moments(&mut self, gpu: &Arc<Gpu>, model: &Model) -> Result<(), Error> {
        if self.moments.is_some() {
            return Ok(());
        }
        if gpu.info().max_storage_buffers < BUFFERS_WITH_MOMENTS {
            return Err(too_large(
                "the device binds too few storage buffers at once",
            ));
        }
        let moments: &[SurfaceMoments] = &model.tree.moments;
        let data: &[u8] = bytemuck::cast_slice(moments);
        let bytes = data.len() as u64;
        fits_bindings(gpu, [bytes])?;
        fits_memory(gpu, self.bytes() + bytes)?;
        self.moments = Some(filled(gpu, "moments of nodes", data)?);
        Ok(())
    }

    /// Moments of nodes.
    ///
    /// # Errors
    /// When nothing has [added](Self::add_moments) them.
    pub(crate) fn moments(&self) -> Result<&DeviceBuffer, Error> {
        let moments = self.moments.as_ref();
        moments.ok_or_else(|| too_large("it has no moments for filtered splats"))
    }

    /// Copies what patches are made of besides, unless it is there.
    ///
    /// # Errors
    /// When it does not fit, or a Vulkan call fails.
    pub(crate) fn add_patches(
        &mut self,
        gpu: &Arc<Gpu>,
        (patches, places): (&PatchRecords, &[PatchTexture]),
    ) -> Result<(), Error> {
        if self.patches.is_some() {
            return Ok(());
        }
        let records: &[u8] = bytemuck::cast_slice(&patches.records);
        let colors: &[u8] = bytemuck::cast_slice(&patches.colors);
        let places: &[u8] = bytemuck::cast_slice(places);
        let bytes = [records, colors, places].map(|data| data.len() as u64);
        fits_bindings(gpu, bytes)?;
        fits_memory(gpu, self.bytes() + bytes.into_iter().sum::<u64>())?;
        let if_any = |name: &str, data: &[u8]| {
            let any = !data.is_empty();
            any.then(|| filled(gpu, name, data)).transpose()
        };
        self.patches = Some(DevicePatches {
            records: filled(gpu, "patches of nodes", records)?,
            colors: if_any("colors of patches", colors)?,
            places: if_any("places of patches of nodes", places)?,
        });
        Ok(())
    }

    /// Records of patches.
    ///
    /// # Errors
    /// When nothing has [added](Self::add_patches) them.
    pub(crate) fn patches(&self) -> Result<&DevicePatches, Error> {
        let patches = self.patches.as_ref();
        patches.ok_or_else(|| too_large("it has no records of patches"))
    }

    /// Places of patches in images, one a node.
    ///
    /// # Errors
    /// When nothing has [added](Self::add_patches) them, or the model has no images.
    pub(crate) fn places_of_patches(&self) -> Result<&DeviceBuffer, Error> {
        let places = self.patches()?.places.as_ref();
        places.ok_or_else(|| too_large("it has no places of patches in images"))
    }

    /// Tells whether it is that of the scene.
    pub(crate) fn is_of(&self, scene: &DeviceScene) -> bool {
        self.scene == scene.id()
    }

    /// Buffers that records of splats are made of: the tree, and the vertices of the page that it lies in.
    pub(crate) fn buffers_of_splats<'a>(&'a self, page: &'a ScenePage) -> [&'a dyn AnyBuffer; 5] {
        [
            &self.nodes,
            &self.attributes,
            &self.leaves,
            &self.corners,
            &page.vertices,
        ]
    }

    /// Bytes of all of it.
    pub(crate) fn bytes(&self) -> u64 {
        let all = [&self.nodes, &self.attributes, &self.leaves, &self.corners];
        let patches = self.patches.iter();
        let patches = patches.flat_map(|own| {
            let DevicePatches {
                records,
                colors,
                places,
            } = own;
            [Some(records), colors.as_ref(), places.as_ref()]
        });
        let all = (all.into_iter().chain(&self.moments)).chain(patches.flatten());
        all.map(AnyBuffer::bytes).sum()
    }
}

/// A storage buffer with these bytes.
///
/// # Errors
/// When memory runs out or a Vulkan call fails.
fn filled(gpu: &Arc<Gpu>, name: &str, data: &[u8]) -> Result<DeviceBuffer, Error> {
    // A buffer has a byte at least; nothing is looked at of what is not there.
    let data = if data.is_empty() { &[0; 32][..] } else { data };
    DeviceBuffer::with_data(gpu, name, BufferUsage::Storage, data)
}

/// The page that all of a scene lies in.
///
/// # Errors
/// When there are several.
pub(crate) fn page_of(scene: &DeviceScene) -> Result<&ScenePage, Error> {
    match scene.pages.as_slice() {
        [page] => Ok(page),
        _ => Err(too_large(
            "the vertices do not fit one buffer of the device",
        )),
    }
}

/// Bytes of the largest buffer that can be bound as storage.
pub(crate) fn most_bound(gpu: &Gpu) -> u64 {
    let info = gpu.info();
    info.max_storage_range.min(info.max_buffer)
}

/// # Errors
/// When one of so many bytes is too large to be bound as storage.
pub(crate) fn fits_bindings(gpu: &Gpu, bytes: impl IntoIterator<Item = u64>) -> Result<(), Error> {
    let limit = most_bound(gpu);
    match bytes.into_iter().all(|bytes| bytes <= limit) {
        true => Ok(()),
        false => Err(too_large(
            "a list does not fit one storage binding of the device",
        )),
    }
}

/// # Errors
/// When so many bytes would leave no room: the model itself and the targets need some as well.
pub(crate) fn fits_memory(gpu: &Gpu, bytes: u64) -> Result<(), Error> {
    match bytes <= gpu.info().device_memory / 2 {
        true => Ok(()),
        false => Err(too_large(
            "tree and lists take more than half of the device's memory",
        )),
    }
}

fn too_large(why: &str) -> Error {
    Error::Unsupported {
        what: "the tree on the device",
        why: why.into(),
    }
}
