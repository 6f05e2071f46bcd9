//! Structs of options whose fields are written once, with [`options!`](crate::options!): name, type, default, range,
//! documentation. The program and Python set them by the table, C's struct and all documentation are generated from it.

use crate::choice::Enumeration;
use crate::{Error, Result};

/// A field of a struct of options as data.
#[derive(Clone, Debug)]
pub struct Field {
    /// Its name in Rust and in C.
    pub name: &'static str,
    /// Lines of its documentation in Rust; translated, also in C.
    pub doc: &'static [&'static str],
    /// What values it takes.
    pub kind: Kind,
    /// Its default.
    pub default: Value,
    /// What is not in its type.
    pub facts: Facts,
}

/// What is known of an option besides its type and default.
#[derive(Clone, Copy, Debug)]
pub struct Facts {
    /// One or two sentences for the program and Python, by the program's names.
    pub help: &'static str,
    /// Which of its type's values are allowed.
    pub range: Option<Range>,
    /// Its name in Python where that is not the field's; in kebab case, the program's.
    pub short: Option<&'static str>,
    /// What stands for the value in the program's help.
    pub value_name: Option<&'static str>,
    /// What no value means, where it may have none.
    pub none: Option<&'static str>,
    /// Faces that do not have it, or not by this table: they have written something of their own.
    pub apart: &'static [Face],
}

impl Facts {
    /// Nothing.
    pub const NONE: Self =
        Self { help: "", range: None, short: None, value_name: None, none: None, apart: &[] };
}

/// Who offers options to users.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Face {
    /// `vg.h`.
    C,
    /// The package `vehicle_gaussians`, by its extension module and by C.
    Python,
    /// `vg`.
    Program,
}

/// Allowed numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// The number must be above this, or this where `closed`.
    pub low: f64,
    /// Whether `low` itself is allowed.
    pub closed: bool,
    /// The largest number.
    pub high: f64,
    /// The same in words, as errors say it.
    pub words: &'static str,
}

impl Range {
    /// From `low` to `high`, both allowed.
    pub const fn closed(low: f64, high: f64, words: &'static str) -> Self {
        Self { low, closed: true, high, words }
    }

    /// Above `low`, at most `high`.
    pub const fn above(low: f64, high: f64, words: &'static str) -> Self {
        Self { low, closed: false, high, words }
    }

    /// Whether a number is allowed; NaN and infinities never are.
    pub fn contains(&self, number: f64) -> bool {
        let above = if self.closed { number >= self.low } else { number > self.low };
        number.is_finite() && above && number <= self.high
    }
}

/// What values an option takes.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    /// One of an enumeration.
    Choice(fn() -> Enumeration),
    /// Any of an enumeration, together.
    Set(fn() -> Enumeration),
    /// Yes or no.
    Flag,
    /// A whole number.
    Whole,
    /// A whole number, or none.
    MaybeWhole,
    /// A number.
    Real,
    /// A number, or none.
    MaybeReal,
}

/// A value of an option.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// No value.
    Absent,
    /// Yes or no.
    Flag(bool),
    /// A whole number.
    Whole(u64),
    /// A number.
    Real(f64),
    /// One of an enumeration.
    Name(String),
    /// Any of an enumeration.
    Names(Vec<String>),
}

impl Value {
    /// The error of a value of the wrong kind.
    pub fn refused(&self, argument: &str, allowed: &str) -> Error {
        Error::argument(argument, self.found(), allowed)
    }

    /// The number that a [`Range`] is about.
    fn number(&self) -> Option<f64> {
        match self {
            Self::Whole(number) => Some(*number as f64),
            Self::Real(number) => Some(*number),
            _ => None,
        }
    }

    /// The number as errors name it.
    fn found(&self) -> String {
        match self {
            Self::Whole(number) => number.to_string(),
            Self::Real(number) => number.to_string(),
            other => format!("{other:?}"),
        }
    }
}

/// A type that options have.
pub trait Setting: Sized {
    /// What values it takes.
    const KIND: Kind;

    /// The value as data.
    fn value(&self) -> Value;

    /// The value of data; ranges are left to [`check`].
    ///
    /// # Errors
    /// [`Error::Argument`] for data of another kind.
    fn from_value(argument: &str, value: Value) -> Result<Self>;
}

/// The value in its range, if there is one.
///
/// # Errors
/// [`Error::Argument`] with the range's words.
pub fn check(argument: &str, value: &Value, facts: &Facts) -> Result<()> {
    match (facts.range, value.number()) {
        (Some(range), Some(number)) if !range.contains(number) => {
            Err(Error::argument(argument, value.found(), range.words))
        }
        _ => Ok(()),
    }
}

/// A type whose values are of one kind, or absent.
macro_rules! setting {
    ($type:ty, $kind:expr, $allowed:literal, $value:expr, $from_value:expr) => {
        impl Setting for $type {
            const KIND: Kind = $kind;

            fn value(&self) -> Value {
                let value: fn($type) -> Value = $value;
                value(*self)
            }

            fn from_value(argument: &str, value: Value) -> Result<Self> {
                let from_value: fn(&Value) -> Option<Self> = $from_value;
                from_value(&value).ok_or_else(|| value.refused(argument, $allowed))
            }
        }
    };
}

setting!(bool, Kind::Flag, "true or false", Value::Flag, |value| match value {
    Value::Flag(yes) => Some(*yes),
    _ => None,
});

setting!(u8, Kind::Whole, "0 to 255", |number| Value::Whole(number.into()), |value| match value {
    Value::Whole(number) => u8::try_from(*number).ok(),
    _ => None,
});

setting!(usize, Kind::Whole, "a whole number", |number| Value::Whole(number as u64), |value| match value {
    Value::Whole(number) => usize::try_from(*number).ok(),
    _ => None,
});

setting!(
    Option<usize>,
    Kind::MaybeWhole,
    "a whole number, or none",
    |number| number.map_or(Value::Absent, |number| Value::Whole(number as u64)),
    |value| match value {
        Value::Absent => Some(None),
        Value::Whole(number) => usize::try_from(*number).ok().map(Some),
        _ => None,
    }
);

setting!(f64, Kind::Real, "a number", Value::Real, |value| match value {
    Value::Real(number) => Some(*number),
    _ => None,
});

setting!(
    Option<f64>,
    Kind::MaybeReal,
    "a number, or none",
    |number| number.map_or(Value::Absent, Value::Real),
    |value| match value {
        Value::Absent => Some(None),
        Value::Real(number) => Some(Some(*number)),
        _ => None,
    }
);

/// Defines a struct of options: a default after each field, and what else is known of it ([`Facts`]). Makes the struct,
/// its `Default`, and `fields`, `set` and `check_ranges`. A field without facts is of a kind that each face has in a
/// form of its own, and is no part of the table.
///
/// ```
/// use vg_geometry::options::{Range, Value};
/// vg_geometry::options! {
///     /// How to drive.
///     #[derive(Debug, PartialEq)]
///     pub struct Drive {
///         /// Metres per second.
///         pub speed: f64 = 10.0 => { help: "Speed", range: Some(Range::above(0.0, 90.0, "above 0, at most 90")), },
///         /// Where to.
///         pub to: Option<[f64; 2]> = None,
///     }
/// }
/// let mut drive = Drive::default();
/// drive.set("speed", Value::Real(20.0)).unwrap();
/// assert_eq!(drive, Drive { speed: 20.0, to: None });
/// let error = Drive { speed: 0.0, to: None }.check_ranges("options").unwrap_err();
/// assert!(error.to_string().contains("options.speed: 0"), "{error}");
/// ```
#[macro_export]
macro_rules! options {
    (
        $(#[$meta:meta])*
        pub struct $Type:ident {
            $( $(#[$($field_meta:tt)*])* pub $field:ident : $type:ty = $default:expr $(=> $facts:tt)? ),* $(,)?
        }
    ) => {
        $(#[$meta])*
        pub struct $Type {
            $( $(#[$($field_meta)*])* pub $field: $type, )*
        }

        impl Default for $Type {
            fn default() -> Self {
                Self { $( $field: $default, )* }
            }
        }

        impl $Type {
            /// The table of the options, in the order of the struct.
            pub fn fields() -> Vec<$crate::options::Field> {
                let default = Self::default();
                let docs: &[(&str, &'static [&'static str])] =
                    &[$( (stringify!($field), &[$( $crate::doc_line!($($field_meta)*) ),*]) ),*];
                let doc = |name| docs.iter().find(|doc| doc.0 == name).map_or(&[][..], |doc| doc.1);
                let all = [$( $( {
                    let facts: $crate::options::Facts = $crate::facts!($facts);
                    Some($crate::options::Field {
                        name: stringify!($field),
                        doc: doc(stringify!($field)),
                        kind: <$type as $crate::options::Setting>::KIND,
                        default: $crate::options::Setting::value(&default.$field),
                        facts,
                    })
                }, )? )* None];
                all.into_iter().flatten().collect()
            }

            /// Sets an option of the table by its name, without a look at its range.
            ///
            /// # Errors
            /// [`Error::Argument`](vg_geometry::Error::Argument) for a value of another kind, or an unknown name.
            pub fn set(&mut self, name: &str, value: $crate::options::Value) -> $crate::Result<()> {
                $( $( if name == stringify!($field) {
                    let _: $crate::options::Facts = $crate::facts!($facts);
                    self.$field = $crate::options::Setting::from_value(name, value)?;
                    return Ok(());
                } )? )*
                Err($crate::Error::argument("options", name, "the name of an option"))
            }

            /// The value of an option of the table.
            pub fn get(&self, name: &str) -> Option<$crate::options::Value> {
                $( $( if name == stringify!($field) {
                    let _: $crate::options::Facts = $crate::facts!($facts);
                    return Some($crate::options::Setting::value(&self.$field));
                } )? )*
                None
            }

            /// Each option of the table in its range.
            ///
            /// # Errors
            /// [`Error::Argument`](vg_geometry::Error::Argument) with the first that is not, behind `prefix` and a dot.
            pub fn check_ranges(&self, prefix: &str) -> $crate::Result<()> {
                for field in Self::fields() {
                    if let Some(value) = self.get(field.name) {
                        $crate::options::check(&format!("{prefix}.{}", field.name), &value, &field.facts)?;
                    }
                }
                Ok(())
            }
        }
    };
}

/// [`Facts`](options::Facts) of those that are given.
#[doc(hidden)]
#[macro_export]
macro_rules! facts {
    ({ $($fact:tt)* }) => {
        $crate::options::Facts { $($fact)* ..$crate::options::Facts::NONE }
    };
}
