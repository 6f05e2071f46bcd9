//! Enumerations that users choose from. Names, numbers and documentation are written once, with
//! [`choices!`](crate::choices!); the program, C and Python parse by them, and their declarations and documentation are
//! generated from them.

use crate::{Error, Result};

/// An enumeration that [`choices!`](crate::choices) makes.
pub trait Choice: Copy + PartialEq + 'static {
    /// Its name in Rust.
    const TYPE: &'static str;
    /// Its name in C without `vg_`, in snake case; in CamelCase its name in Python.
    const NAME: &'static str;
    /// Lines of its documentation.
    const DOC: &'static [&'static str];
    /// All variants, in the order in which users see them.
    const ALL: &'static [Self];

    /// What is known of a variant.
    fn variant(self) -> Variant;

    /// The variant of this name in the program, in Python and in reports.
    ///
    /// # Errors
    /// [`Error::Argument`] with all names.
    fn from_name(argument: &str, name: &str) -> Result<Self> {
        Self::ALL.iter().copied().find(|choice| choice.variant().name == name).ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|choice| choice.variant().name).collect();
            Error::argument(argument, format!("{name:?}"), names.join(", "))
        })
    }

    /// The variant of this number in C.
    ///
    /// # Errors
    /// [`Error::Argument`] with all numbers and names.
    fn from_number(argument: &str, number: i32) -> Result<Self> {
        Self::ALL.iter().copied().find(|choice| choice.variant().number == number).ok_or_else(|| {
            let mut known: Vec<Variant> = Self::ALL.iter().map(|choice| choice.variant()).collect();
            known.sort_by_key(|variant| variant.number);
            let allowed: Vec<String> = known.iter().map(|v| format!("{} ({})", v.number, v.name)).collect();
            Error::argument(argument, number.to_string(), allowed.join(", "))
        })
    }

    /// What faces are generated from.
    fn enumeration() -> Enumeration {
        let variants = Self::ALL.iter().map(|choice| choice.variant()).collect();
        Enumeration { type_name: Self::TYPE, name: Self::NAME, doc: Self::DOC, variants }
    }
}

/// One of a [`Choice`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    /// Its name in Rust.
    pub ident: &'static str,
    /// Its name in the program, in Python and in reports.
    pub name: &'static str,
    /// Its number in C; never changed, never reused.
    pub number: i32,
    /// Lines of its documentation.
    pub doc: &'static [&'static str],
}

/// A [`Choice`] as data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Enumeration {
    /// Its name in Rust.
    pub type_name: &'static str,
    /// Its name in C without `vg_`, in snake case.
    pub name: &'static str,
    /// Lines of its documentation.
    pub doc: &'static [&'static str],
    /// All variants, in the order in which users see them.
    pub variants: Vec<Variant>,
}

/// Defines an enumeration that users choose from: `Variant = number "name"`, after the documentation of each. The number
/// is C's, the name is that of the program, of Python and of reports, as `Serialize` writes it.
///
/// ```
/// vg_geometry::choices! {
///     /// Where the engine is.
///     #[derive(Default)]
///     pub enum Engine as "engine" {
///         /// In front.
///         #[default]
///         Front = 0 "front",
///         /// Behind the rear axle.
///         Rear = 1 "rear",
///     }
/// }
/// use vg_geometry::Choice;
/// assert_eq!(Engine::from_name("engine", "rear").unwrap(), Engine::Rear);
/// assert_eq!(Engine::from_number("engine", 0).unwrap().name(), "front");
/// let error = Engine::from_number("engine", 2).unwrap_err().to_string();
/// assert!(error.contains("0 (front), 1 (rear)"), "{error}");
/// ```
#[macro_export]
macro_rules! choices {
    (
        $(#[$($meta:tt)*])*
        pub enum $Type:ident as $c:literal {
            $( $(#[$($variant_meta:tt)*])* $Variant:ident = $number:literal $name:literal ),+ $(,)?
        }
    ) => {
        $(#[$($meta)*])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $Type {
            $( $(#[$($variant_meta)*])* $Variant, )+
        }

        impl $Type {
            /// Its name in the program, in Python and in reports.
            pub const fn name(self) -> &'static str {
                match self { $( Self::$Variant => $name, )+ }
            }

            /// Its number in C.
            pub const fn number(self) -> i32 {
                match self { $( Self::$Variant => $number, )+ }
            }
        }

        impl $crate::Choice for $Type {
            const TYPE: &'static str = stringify!($Type);
            const NAME: &'static str = $c;
            const DOC: &'static [&'static str] = &[$( $crate::doc_line!($($meta)*) ),*];
            const ALL: &'static [Self] = &[$( Self::$Variant ),+];

            fn variant(self) -> $crate::choice::Variant {
                match self { $( Self::$Variant => $crate::choice::Variant {
                    ident: stringify!($Variant),
                    name: $name,
                    number: $number,
                    doc: &[$( $crate::doc_line!($($variant_meta)*) ),*],
                }, )+ }
            }
        }

        impl $crate::options::Setting for $Type {
            const KIND: $crate::options::Kind =
                $crate::options::Kind::Choice(<Self as $crate::Choice>::enumeration);

            fn value(&self) -> $crate::options::Value {
                $crate::options::Value::Name(self.name().into())
            }

            fn from_value(argument: &str, value: $crate::options::Value) -> $crate::Result<Self> {
                match value {
                    $crate::options::Value::Name(name) => <Self as $crate::Choice>::from_name(argument, &name),
                    other => Err(other.refused(argument, "a name")),
                }
            }
        }

        impl ::serde::Serialize for $Type {
            fn serialize<S: ::serde::Serializer>(&self, serializer: S) -> ::core::result::Result<S::Ok, S::Error> {
                serializer.serialize_str(self.name())
            }
        }
    };
}

/// The text of a line of documentation; nothing of another attribute.
#[doc(hidden)]
#[macro_export]
macro_rules! doc_line {
    (doc = $line:literal) => {
        $line
    };
    ($($other:tt)*) => {
        ""
    };
}
