//! Reads NumPy's `.npz`, a zip of `.npy` arrays, in the types that the golden renders use (little-endian f4, f8, i4,
//! U).

use std::collections::HashMap;
use std::io::Read;
use std::path::Path;

pub struct Npz {
    arrays: HashMap<String, Array>,
}

pub struct Array {
    pub shape: Vec<usize>,
    /// Numbers; empty for text.
    pub values: Vec<f64>,
    /// Text; empty for numbers.
    pub text: Vec<String>,
}

impl Npz {
    pub fn open(path: &Path) -> Self {
        let file = std::fs::File::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let mut archive = zip::ZipArchive::new(file).unwrap();
        let mut arrays = HashMap::new();
        for i in 0..archive.len() {
            let mut entry = archive.by_index(i).unwrap();
            let name = entry.name().trim_end_matches(".npy").to_owned();
            let mut bytes = Vec::new();
            entry.read_to_end(&mut bytes).unwrap();
            arrays.insert(name, Array::parse(&bytes));
        }
        Self { arrays }
    }

    pub fn get(&self, name: &str) -> Option<&Array> {
        self.arrays.get(name)
    }

    pub fn array(&self, name: &str) -> &Array {
        self.get(name).unwrap_or_else(|| panic!("no array {name}"))
    }

    pub fn scalar(&self, name: &str) -> f64 {
        self.array(name).values[0]
    }

    pub fn f32(&self, name: &str) -> Vec<f32> {
        self.array(name).values.iter().map(|&v| v as f32).collect()
    }
}

impl Array {
    fn parse(bytes: &[u8]) -> Self {
        assert_eq!(&bytes[..6], b"\x93NUMPY");
        // Version 1 has a 2-byte header length, later ones 4 bytes.
        let (start, len) = match bytes[6] {
            1 => (10, usize::from(u16::from_le_bytes([bytes[8], bytes[9]]))),
            _ => (12, u32::from_le_bytes(bytes[8..12].try_into().unwrap()) as usize),
        };
        let header = std::str::from_utf8(&bytes[start..start + len]).unwrap();
        let between = |from: &str, to: char| {
            let rest = &header[header.find(from).unwrap() + from.len()..];
            &rest[..rest.find(to).unwrap()]
        };
        assert!(header.contains("'fortran_order': False"), "{header}");
        let shape: Vec<usize> =
            between("'shape': (", ')').split(',').filter_map(|s| s.trim().parse().ok()).collect();
        let descr = between("'descr': '", '\'');
        let data = &bytes[start + len..];
        let mut values = Vec::new();
        let mut text = Vec::new();
        match &descr[1..] {
            "f4" => values.extend(chunks(data).map(|b| f64::from(f32::from_le_bytes(b)))),
            "f8" => values.extend(chunks(data).map(f64::from_le_bytes)),
            "i4" => values.extend(chunks(data).map(|b| f64::from(i32::from_le_bytes(b)))),
            "i8" => values.extend(chunks(data).map(|b| i64::from_le_bytes(b) as f64)),
            kind if kind.starts_with('U') => {
                let width: usize = kind[1..].parse().unwrap();
                for one in data.chunks_exact(4 * width) {
                    let codes = chunks(one).map(u32::from_le_bytes).filter(|&c| c != 0);
                    text.push(codes.filter_map(char::from_u32).collect());
                }
            }
            _ => {} // not needed by any test
        }
        Self { shape, values, text }
    }
}

fn chunks<const N: usize>(data: &[u8]) -> impl Iterator<Item = [u8; N]> + '_ {
    data.chunks_exact(N).map(|b| b.try_into().unwrap())
}
