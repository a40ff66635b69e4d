//! Material files of OBJ: the diffuse color of each material and the names of textures, nothing else.

use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::assemble::color_from_unit;
use super::text::{Scanner, parse_f64, shown, words};

/// A material file longer than this is none.
const LARGEST_BYTES: u64 = 64 << 20;

/// Diffuse colors by material name; a material without a usable `Kd` is white.
#[derive(Debug, Default)]
pub(super) struct Materials {
    pub(super) diffuse: HashMap<Vec<u8>, [u8; 4]>,
    /// Diffuse textures that were named.
    pub(super) textures: Vec<String>,
}

impl Materials {
    /// Adds the materials of a file; a material defined twice keeps its last color.
    ///
    /// # Errors
    /// A sentence why the file cannot be read. Its content never is an error: lines that are not understood define
    /// nothing.
    pub(super) fn add_file(&mut self, path: &Path) -> Result<(), String> {
        // A model must not make us wait for a pipe or a device.
        let metadata = std::fs::metadata(path).map_err(|error| error.to_string())?;
        if !metadata.is_file() {
            return Err("not a file".to_owned());
        }
        let file = File::open(path).map_err(|error| error.to_string())?;
        let mut data = Vec::new();
        file.take(LARGEST_BYTES)
            .read_to_end(&mut data)
            .map_err(|error| error.to_string())?;
        self.add(&data);
        Ok(())
    }

    fn add(&mut self, data: &[u8]) {
        let mut scanner = Scanner::new(data, 0);
        let mut current: Option<Vec<u8>> = None;
        while let Some((line, _)) = scanner.line() {
            let line = line.trim_ascii();
            let mut line_words = words(line);
            match line_words.next() {
                Some(b"newmtl") => {
                    let name = line[b"newmtl".len()..].trim_ascii().to_vec();
                    self.diffuse.insert(name.clone(), [255; 4]);
                    current = Some(name);
                }
                Some(b"Kd") => {
                    let mut channel = || line_words.next().and_then(parse_f64);
                    // `Kd spectral file` and `Kd xyz` are not colors we can use; a single number is a gray.
                    let Some(red) = channel() else { continue };
                    let (green, blue) = (channel().unwrap_or(red), channel().unwrap_or(red));
                    if let Some(color) =
                        current.as_ref().and_then(|name| self.diffuse.get_mut(name))
                    {
                        let [r, g, b] = [red, green, blue].map(color_from_unit);
                        *color = [r, g, b, 255];
                    }
                }
                Some(keyword) if keyword.eq_ignore_ascii_case(b"map_Kd") => {
                    if let Some(name) = line_words.last() {
                        self.textures.push(shown(name));
                    }
                }
                _ => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn diffuse_colors_by_name() {
        let mut materials = Materials::default();
        materials.add(
            b"Kd 1 0 0\n# c\nnewmtl red one\r\nKd 1 0 0\r\nmap_Kd -s 1 1 a.png\nnewmtl gray\nKd 0.5\nmap_Kd \n\
              newmtl odd\nKd spectral a.rfl\nKd\n",
        );
        assert_eq!(materials.diffuse[&b"red one"[..]], [255, 0, 0, 255]);
        assert_eq!(materials.diffuse[&b"gray"[..]], [128, 128, 128, 255]);
        assert_eq!(materials.diffuse[&b"odd"[..]], [255; 4]);
        assert_eq!(materials.diffuse.len(), 3);
        assert_eq!(materials.textures, ["a.png"]);
    }
}
