//! Gaussians in the layout of 3DGS's `point_cloud.ply`, which viewers support.
//!
//! Binary little-endian floats: `x y z nx ny nz f_dc_0..2 f_rest_* opacity scale_0..2 rot_0..3`, where opacity is
//! a logit, scales are natural logarithms of metres, rot is (w, x, y, z), and `f_rest` is channel-major: all of
//! red's coefficients above degree 0, then green's, then blue's.

use super::foreign;
use super::header::{self, Header, Property};
use super::rows::{self, finite};
use super::variant::Variant;
use crate::io::files::write_atomically;
use crate::io::splats::SplatFormat;
use crate::io::stream;
use std::io::{BufRead, Write};
use std::path::Path;
use vg_geometry::{Error, Result};
use vg_splat::Gaussians;
use vg_splat::gaussians::buffer::{SCALE_RANGE, normalize_quaternion};
use vg_splat::gaussians::sh;

/// A logit whose logistic function is exactly 1 in f32: above ln(2^25), where 1 + exp(-x) rounds to 1.
const LOGIT_OF_ONE: f32 = 20.0;

/// A logit whose logistic function is exactly 0 in f32: below the logarithm of half the smallest f32, -103.97.
const LOGIT_OF_ZERO: f32 = -110.0;

/// Notes on what was ignored or changed when Gaussians were read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PlyNotes {
    /// The number of scales (three per Gaussian) below the smallest normal f32, which were raised to it.
    pub clamped_scales: usize,
    /// Vertex properties that were ignored, in the file's order, except normals.
    pub ignored: Vec<String>,
}

/// PLY among the formats of models.
pub const FORMAT: SplatFormat = SplatFormat {
    name: "PLY",
    endings: &["ply"],
    recognizes: |first| first.starts_with(b"ply"),
    read: |input, length, path| read_stream(input, length, path),
    write: write_to,
};

/// Reads the Gaussians in a PLY file. Properties may have any order and any scalar type, with others between. The file
/// may be a pipe: it is read once, from start to end. Other formats, and Gaussians of other kinds, are errors that name
/// them and the way out.
pub fn read(path: &Path) -> Result<(Gaussians, PlyNotes)> {
    let stream = stream::open(path)?;
    read_stream(stream.input, stream.length, path)
}

/// Reads Gaussians from any source of `length` bytes, as [`read`]; `path` is for messages only.
pub fn read_from(input: impl BufRead, length: u64, path: &Path) -> Result<(Gaussians, PlyNotes)> {
    read_stream(input, Some(length), path)
}

fn read_stream(input: impl BufRead, length: Option<u64>, path: &Path) -> Result<(Gaussians, PlyNotes)> {
    let (header, input) = header::open(input, length, path)?;
    read_rows(input, &header, &Layout::from_header(&header, path)?, path)
}

/// Reads the Gaussians that follow a header.
pub(super) fn read_rows(
    input: impl BufRead,
    header: &Header,
    layout: &Layout,
    path: &Path,
) -> Result<(Gaussians, PlyNotes)> {
    let mut notes = PlyNotes { ignored: layout.ignored(header), ..PlyNotes::default() };
    let n = header.reserve;
    let (mut means, mut rotations) = (Vec::with_capacity(n), Vec::with_capacity(n));
    let (mut scales, mut opacities) = (Vec::with_capacity(n), Vec::with_capacity(n));
    let mut colors = Vec::with_capacity(n * layout.sh.len());
    rows::for_each(input, header, path, |vertex, row| {
        let broken =
            |name: &str, reason: String| Error::format(path, format!("vertex {vertex}.{name}"), reason);
        let get = |property: &Property| finite(row, property, vertex, path);

        let [x, y, z] = layout.mean;
        means.push([get(x)?, get(y)?, get(z)?]);
        let mut scale = [0.0; 3];
        for (scale, property) in scale.iter_mut().zip(layout.scale) {
            let log = rows::value(row, property);
            *scale = scale_from_log(log, &mut notes.clamped_scales)
                .ok_or_else(|| broken(&property.name, format!("{log}; allowed: ln of at most 1e9 m")))?;
        }
        scales.push(scale);
        // A logit of 1e4 is opaque, and so is infinity.
        let logit = rows::value(row, layout.opacity);
        if logit.is_nan() {
            return Err(broken("opacity", "NaN; allowed: a number".into()));
        }
        opacities.push((1.0 / (1.0 + (-logit).exp())) as f32);
        let [w, x, y, z] = layout.rotation;
        let rotation = [get(w)?, get(x)?, get(y)?, get(z)?];
        rotations.push(normalize_quaternion(rotation).ok_or_else(|| {
            broken("rot_0", format!("quaternion {rotation:?}; allowed: (w, x, y, z), not zero"))
        })?);
        for property in &layout.sh {
            colors.push(get(property)?);
        }
        Ok(())
    })?;
    let gaussians = Gaussians::from_arrays(layout.degree, means, rotations, scales, opacities, colors)?;
    Ok((gaussians, notes))
}

/// exp of a stored scale. Underflow, also of minus infinity, becomes the smallest normal f32 and is counted.
fn scale_from_log(log: f64, clamped: &mut usize) -> Option<f32> {
    let (smallest, largest) = (*SCALE_RANGE.start(), *SCALE_RANGE.end());
    // The logarithm of the largest scale, rounded to f32, may lie half a step (1e-6) above it.
    if log.is_nan() || log > f64::from(largest).ln() + 2e-6 {
        return None;
    }
    let scale = log.exp() as f32;
    if scale < smallest {
        *clamped += 1;
        return Some(smallest);
    }
    Some(scale.min(largest))
}

/// The properties of each part of a Gaussian in a row.
pub(super) struct Layout<'a> {
    mean: [&'a Property; 3],
    scale: [&'a Property; 3],
    rotation: [&'a Property; 4],
    opacity: &'a Property,
    degree: u8,
    /// SH coefficients in this library's order, `[(degree + 1)^2][3]`.
    sh: Vec<&'a Property>,
}

impl<'a> Layout<'a> {
    pub(super) fn from_header(header: &'a Header, path: &Path) -> Result<Self> {
        let variant = Variant::from_header(header);
        let find = |name: &str| {
            let missing = || {
                let reason = match variant {
                    Some(v) => {
                        format!("missing: this is {}; allowed: 3DGS's layout; {}", v.kind(), v.way_out())
                    }
                    None => "missing; allowed: 3DGS's layout".into(),
                };
                Error::format(path, format!("property {name}"), reason)
            };
            header.find(name).ok_or_else(missing)
        };
        let mean = [find("x")?, find("y")?, find("z")?];
        let degree = match header.properties.iter().filter(|p| p.name.starts_with("f_rest_")).count() {
            0 => 0,
            9 => 1,
            24 => 2,
            45 => 3,
            n => {
                let kind = variant.map_or_else(String::new, |v| format!(", {}: {}", v.kind(), v.way_out()));
                let reason = format!("{n} of them{kind}; allowed: 0, 9, 24 or 45 (SH degree 0 to 3)");
                return Err(Error::format(path, "property f_rest_*", reason));
            }
        };
        let above = sh::coefficients(degree) - 1;
        let mut colors = vec![find("f_dc_0")?, find("f_dc_1")?, find("f_dc_2")?];
        for k in 0..above {
            for channel in 0..3 {
                colors.push(find(&format!("f_rest_{}", channel * above + k))?);
            }
        }
        Ok(Self {
            mean,
            scale: [find("scale_0")?, find("scale_1")?, find("scale_2")?],
            rotation: [find("rot_0")?, find("rot_1")?, find("rot_2")?, find("rot_3")?],
            opacity: find("opacity")?,
            degree,
            sh: colors,
        })
    }

    /// Names of properties that are neither part of the layout nor normals.
    fn ignored(&self, header: &Header) -> Vec<String> {
        let parts = [&self.mean[..], &self.scale, &self.rotation, &self.sh, &[self.opacity]];
        let is_used = |name: &str| parts.iter().any(|part| part.iter().any(|p| p.name == name));
        let names = header.properties.iter().map(|p| &p.name);
        names.filter(|name| !is_used(name) && !["nx", "ny", "nz"].contains(&name.as_str())).cloned().collect()
    }
}

/// Writes the Gaussians to `path`; an existing file is replaced once the new one is complete. The extension of another
/// format, as in car.spz, is an error.
pub fn write(path: &Path, gaussians: &Gaussians) -> Result<()> {
    foreign::refuse_name(path)?;
    write_atomically(path, |out| write_to(out, gaussians))
}

/// Writes the Gaussians as a PLY file, a row at a time.
pub fn write_to(out: &mut dyn Write, gaussians: &Gaussians) -> std::io::Result<()> {
    let coefficients = sh::coefficients(gaussians.sh_degree());
    let names = property_names(coefficients);
    out.write_all(header_of(gaussians, &names).as_bytes())?;

    let mut row: Vec<f32> = Vec::with_capacity(names.len());
    let mut bytes = Vec::with_capacity(names.len() * 4);
    let stride = gaussians.sh_stride();
    for i in 0..gaussians.len() {
        let colors = &gaussians.sh()[i * stride..(i + 1) * stride];
        row.clear();
        row.extend(gaussians.means()[i]);
        row.extend([0.0; 3]);
        row.extend(&colors[..3]);
        for channel in 0..3 {
            row.extend((1..coefficients).map(|k| colors[3 * k + channel]));
        }
        row.push(logit(gaussians.opacities()[i]));
        row.extend(gaussians.scales()[i].map(|s| f64::from(s).ln() as f32));
        row.extend(gaussians.rotations()[i]);
        bytes.clear();
        bytes.extend(row.iter().flat_map(|v| v.to_le_bytes()));
        out.write_all(&bytes)?;
    }
    Ok(())
}

/// Size of the file of these Gaussians, bytes.
pub fn size_of(gaussians: &Gaussians) -> usize {
    let names = property_names(sh::coefficients(gaussians.sh_degree()));
    header_of(gaussians, &names).len() + gaussians.len() * names.len() * 4
}

/// Properties of a vertex in the order of 3DGS, with `coefficients` per channel of colour.
fn property_names(coefficients: usize) -> Vec<String> {
    let mut names: Vec<String> = ["x", "y", "z", "nx", "ny", "nz"].map(String::from).into();
    names.extend((0..3).map(|i| format!("f_dc_{i}")));
    names.extend((0..3 * (coefficients - 1)).map(|i| format!("f_rest_{i}")));
    names.push("opacity".into());
    names.extend((0..3).map(|i| format!("scale_{i}")));
    names.extend((0..4).map(|i| format!("rot_{i}")));
    names
}

fn header_of(gaussians: &Gaussians, names: &[String]) -> String {
    let properties: String = names.iter().map(|name| format!("property float {name}\n")).collect();
    let count = gaussians.len();
    format!("ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}end_header\n")
}

/// Inverse of the logistic function; exactly 0 and 1 give finite logits that are read back as exactly 0 and 1.
fn logit(opacity: f32) -> f32 {
    if opacity <= 0.0 {
        return LOGIT_OF_ZERO;
    }
    if opacity >= 1.0 {
        return LOGIT_OF_ONE;
    }
    let o = f64::from(opacity);
    (o / (1.0 - o)).ln() as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(degree: u8, n: usize) -> Gaussians {
        let wave = |i: usize, k: usize| ((i * 31 + k * 17) as f32 * 0.37).sin();
        let stride = sh::coefficients(degree) * 3;
        Gaussians::from_arrays(
            degree,
            (0..n).map(|i| [wave(i, 0), wave(i, 1), wave(i, 2)]).collect(),
            (0..n).map(|i| [wave(i, 3), wave(i, 4), wave(i, 5), 0.1]).collect(),
            (0..n).map(|i| [0.01 + wave(i, 6).abs(), 1e-10, 3.0]).collect(),
            (0..n).map(|i| wave(i, 7).abs()).collect(),
            (0..n * stride).map(|i| wave(i, 8)).collect(),
        )
        .unwrap()
    }

    fn bytes_of(gaussians: &Gaussians) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_to(&mut bytes, gaussians).unwrap();
        bytes
    }

    fn read_bytes(bytes: &[u8]) -> Result<(Gaussians, PlyNotes)> {
        read_from(bytes, bytes.len() as u64, Path::new("m.ply"))
    }

    #[test]
    fn written_gaussians_are_read_back_to_the_precision_of_f32_logarithms() {
        for degree in 0..=3 {
            // More than one block of rows.
            let before = sample(degree, 5000);
            let (after, notes) = read_bytes(&bytes_of(&before)).unwrap();
            assert_eq!(notes, PlyNotes::default());
            assert_eq!((after.means(), after.sh()), (before.means(), before.sh()));
            for i in 0..before.len() {
                for k in 0..4 {
                    assert!((after.rotations()[i][k] - before.rotations()[i][k]).abs() <= f32::EPSILON);
                }
                for k in 0..3 {
                    // Half a step of ln(1e-10) in f32 is 0.95e-6.
                    assert!((after.scales()[i][k] / before.scales()[i][k] - 1.0).abs() <= 1.1e-6);
                }
                assert!((after.opacities()[i] - before.opacities()[i]).abs() <= 1.2e-7);
            }
        }
    }

    #[test]
    fn opacities_of_exactly_0_and_1_and_the_largest_and_smallest_scales_survive() {
        let g = Gaussians::from_arrays(
            0,
            vec![[0.0; 3]; 3],
            vec![[1.0, 0.0, 0.0, 0.0]; 3],
            vec![[1e9; 3], [f32::MIN_POSITIVE; 3], [1.0; 3]],
            vec![0.0, 1.0, 1.0 - f32::EPSILON / 2.0],
            vec![0.0; 9],
        )
        .unwrap();
        let (back, _) = read_bytes(&bytes_of(&g)).unwrap();
        assert_eq!(back.opacities(), g.opacities());
        // Half a step of f32 at ln = -87 is 3.8e-6.
        assert!((back.scales()[1][0] / f32::MIN_POSITIVE - 1.0).abs() < 4e-6);
        assert!((back.scales()[0][0] / 1e9 - 1.0).abs() < 2e-6);
        // A viewer that computes in f32 gets the same opacities.
        let sigmoid = |x: f32| 1.0 / (1.0 + (-x).exp());
        assert_eq!((sigmoid(LOGIT_OF_ZERO), sigmoid(LOGIT_OF_ONE)), (0.0, 1.0));
    }

    /// A file of one vertex with these properties.
    fn file(properties: &[(&str, &str, f64)]) -> Vec<u8> {
        let mut bytes = b"ply\r\nformat binary_little_endian 1.0\r\ncomment made by hand\r\n".to_vec();
        bytes.extend(b"element vertex 1\n");
        for (kind, name, _) in properties {
            bytes.extend(format!("property {kind} {name}\n").bytes());
        }
        bytes.extend(b"element face 0\nproperty list uchar int vertex_indices\nend_header\n");
        for &(kind, _, value) in properties {
            match kind {
                "uchar" => bytes.push(value as u8),
                "double" => bytes.extend(value.to_le_bytes()),
                _ => bytes.extend((value as f32).to_le_bytes()),
            }
        }
        bytes
    }

    const ONE: [(&str, &str, f64); 15] = [
        ("double", "rot_3", 0.0),
        ("float", "rot_2", 0.0),
        ("float", "rot_1", 0.0),
        ("float", "rot_0", 2.0),
        ("uchar", "label", 7.0),
        ("float", "scale_0", -1.0),
        ("float", "scale_2", -200.0),
        ("float", "scale_1", f64::NEG_INFINITY),
        ("double", "x", 1.0),
        ("double", "y", 2.0),
        ("uchar", "z", 3.0),
        ("float", "f_dc_0", 0.1),
        ("float", "f_dc_1", 0.2),
        ("float", "f_dc_2", 0.3),
        ("float", "opacity", f64::INFINITY),
    ];

    #[test]
    fn properties_may_have_any_order_and_type_with_others_between() {
        let (g, notes) = read_bytes(&file(&ONE)).unwrap();
        assert_eq!(g.means(), [[1.0, 2.0, 3.0]]);
        assert_eq!(g.rotations(), [[1.0, 0.0, 0.0, 0.0]]);
        assert_eq!(g.scales()[0], [(-1.0f64).exp() as f32, f32::MIN_POSITIVE, f32::MIN_POSITIVE]);
        assert_eq!(g.opacities(), [1.0]);
        assert_eq!(notes, PlyNotes { clamped_scales: 2, ignored: vec!["label".into()] });
    }

    #[test]
    fn a_broken_value_is_an_error_that_names_vertex_and_property() {
        let cases = [
            ("x", f64::NAN, "vertex 0.x"),
            ("f_dc_1", f64::INFINITY, "vertex 0.f_dc_1"),
            ("rot_0", 0.0, "vertex 0.rot_0"),
            ("scale_0", 21.0, "vertex 0.scale_0"),
            ("scale_0", f64::NAN, "vertex 0.scale_0"),
            ("opacity", f64::NAN, "vertex 0.opacity"),
        ];
        for (name, value, field) in cases {
            let mut properties = ONE;
            properties.iter_mut().find(|p| p.1 == name).unwrap().2 = value;
            let error = read_bytes(&file(&properties)).unwrap_err().to_string();
            assert!(error.contains(field), "{error}");
        }
    }
}
