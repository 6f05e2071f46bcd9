//! Parsers of command-line values that are more than a number or a name.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use vg::geometry::Choice;
use vg::pipeline::Options;
use vg::refine::{Amount, RefineOptions};
use vg::render::Background;
use vg::scene::{Place, VehicleBox};

/// Length, width, height in metres. A type of its own because clap treats an array as a list of values.
#[derive(Clone, Copy)]
pub(super) struct VehicleSize(pub(super) [f64; 3]);

pub(super) fn vehicle_size(text: &str) -> Result<VehicleSize, String> {
    let size = numbers::<f64>(text).ok_or("expected length,width,height in metres, three numbers")?;
    match (Options { vehicle_size: Some(size), ..Options::default() }).validate() {
        Ok(()) => Ok(VehicleSize(size)),
        Err(vg::Error::Argument { allowed, .. }) => Err(format!("expected {allowed}")),
        Err(other) => Err(other.to_string()),
    }
}

/// A box, and its pose if given. A type of its own, as [`VehicleSize`] is.
#[derive(Clone, Copy)]
pub(super) struct KnownBox(pub(super) VehicleBox);

pub(super) fn known_box(text: &str) -> Result<KnownBox, String> {
    const EXPECTED: &str = "expected length,width,height in metres, optionally followed by the centre's x,y,z and the yaw in radians";
    let numbers: Vec<f64> =
        text.split(',').map(|part| part.trim().parse()).collect::<Result<_, _>>().map_err(|_| EXPECTED)?;
    let known = match numbers[..] {
        [l, w, h] => VehicleBox { size: [l, w, h], place: None },
        [l, w, h, x, y, z, yaw] => {
            VehicleBox { size: [l, w, h], place: Some(Place { center: [x, y, z], yaw }) }
        }
        _ => return Err(EXPECTED.into()),
    };
    match known.validate("box") {
        Ok(()) => Ok(KnownBox(known)),
        Err(vg::Error::Argument { argument, allowed, .. }) => Err(format!("{argument}: expected {allowed}")),
        Err(other) => Err(other.to_string()),
    }
}

/// Names separated by commas; `\,` is a comma inside a name. A type of its own because clap treats a `Vec` as a list of
/// values.
#[derive(Clone)]
pub(super) struct Names(pub(super) Vec<String>);

pub(super) fn names(text: &str) -> Result<Names, String> {
    let mut names = vec![String::new()];
    let mut rest = text;
    while let Some(at) = rest.find(',') {
        let (before, after) = (&rest[..at], &rest[at + 1..]);
        let last = names.last_mut().ok_or("expected a name")?;
        match before.strip_suffix('\\') {
            Some(before) => last.extend([before, ","]),
            None => {
                last.push_str(before);
                names.push(String::new());
            }
        }
        rest = after;
    }
    names.last_mut().ok_or("expected a name")?.push_str(rest);
    match names.iter().any(String::is_empty) {
        true => Err("expected names separated by commas, with \\, for a comma inside a name".into()),
        false => Ok(Names(names)),
    }
}

pub(super) fn background(text: &str) -> Result<Background, String> {
    match text {
        "white" => Ok(Background::Color([1.0; 3])),
        "black" => Ok(Background::Color([0.0; 3])),
        "transparent" => Ok(Background::Transparent),
        other => numbers::<u8>(other)
            .map(|rgb| Background::Color(rgb.map(|c| f32::from(c) / 255.0)))
            .ok_or_else(|| "expected white, black, transparent, or R,G,B with numbers from 0 to 255".into()),
    }
}

/// One of an enumeration, by name.
pub(super) fn choice<T: Choice + Send + Sync>() -> impl TypedValueParser<Value = T> {
    let names = PossibleValuesParser::new(T::ALL.iter().map(|choice| choice.variant().name));
    names.try_map(|name| T::from_name("", &name))
}

/// Three numbers separated by commas.
fn numbers<T: std::str::FromStr>(text: &str) -> Option<[T; 3]> {
    let numbers: Vec<T> = text.split(',').map(|part| part.trim().parse()).collect::<Result<_, _>>().ok()?;
    numbers.try_into().ok()
}

pub(super) fn picture_size(text: &str) -> Result<(u32, u32), String> {
    let side =
        |text: &str| text.parse().ok().filter(|side| (1..=vg::geometry::camera::MAX_SIDE).contains(side));
    text.split_once('x')
        .and_then(|(w, h)| Some((side(w)?, side(h)?)))
        .ok_or_else(|| format!("expected WxH, each from 1 to {}", vg::geometry::camera::MAX_SIDE))
}

pub(super) fn positive(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|value: &f64| *value > 0.0 && value.is_finite())
        .ok_or_else(|| "expected a number above 0".into())
}

pub(super) fn refinement(text: &str) -> Result<Amount, String> {
    let amount = match text.strip_suffix('s') {
        Some(seconds) => seconds.parse().ok().map(Amount::Seconds),
        None => text.parse().ok().map(Amount::Iterations),
    };
    let amount = amount.ok_or("expected a number of steps (300) or of seconds (5s)")?;
    match (RefineOptions { amount, ..RefineOptions::default() }).validate() {
        Ok(()) => Ok(amount),
        Err(vg::Error::Argument { allowed, .. }) => Err(format!("expected {allowed}")),
        Err(other) => Err(other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commas_separate_names_unless_they_are_escaped() {
        let read = |text: &str| names(text).map(|n| n.0);
        assert_eq!(read("a.png,b").unwrap(), ["a.png", "b"]);
        assert_eq!(read(r"a\,b.png,c\d").unwrap(), ["a,b.png", r"c\d"]);
        assert_eq!(read(r"\,").unwrap(), [","]);
        for bad in ["", "a,,b", "a,"] {
            assert!(read(bad).is_err(), "{bad}");
        }
    }
}
