//! Structs of measures whose fields are written once, with [`measures!`](crate::measures!): name, documentation, heading,
//! digits, direction. Means, tables, C and Python follow.

/// A measure as data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Measure {
    /// Its name in Rust, C, Python and reports, with its unit.
    pub name: &'static str,
    /// Lines of its documentation.
    pub doc: &'static [&'static str],
    /// Its heading in tables; empty: it stands in none.
    pub title: &'static str,
    /// Digits behind the point in tables.
    pub digits: u8,
    /// Which values are good.
    pub better: Better,
    /// Whether there may be none.
    pub may_lack: bool,
}

/// Which values of a measure are good.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    /// Large ones.
    Higher,
    /// Small ones.
    Lower,
    /// Those near to 0: a mean over several is that of absolute values.
    NearZero,
}

/// A type that measures have.
pub trait MeasureValue: Copy {
    /// Whether there may be none.
    const MAY_LACK: bool;

    /// The number, if there is one.
    fn number(self) -> Option<f64>;

    /// From a number; `None` where one is needed and there is none.
    fn from_number(number: Option<f64>) -> Option<Self>;
}

impl MeasureValue for f64 {
    const MAY_LACK: bool = false;

    fn number(self) -> Option<f64> {
        Some(self)
    }

    fn from_number(number: Option<f64>) -> Option<Self> {
        number
    }
}

impl MeasureValue for Option<f64> {
    const MAY_LACK: bool = true;

    fn number(self) -> Option<f64> {
        self
    }

    fn from_number(number: Option<f64>) -> Option<Self> {
        Some(number)
    }
}

/// The mean of a measure over those that have it.
pub fn mean_of(measure: &Measure, numbers: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let (sum, count) = numbers.flatten().fold((0.0, 0usize), |(sum, count), number| {
        (sum + if measure.better == Better::NearZero { number.abs() } else { number }, count + 1)
    });
    (count > 0).then(|| sum / count as f64)
}

/// Defines a struct of measures: heading and digits in tables, and which values are good, after each field. Makes the
/// struct, `MEASURES`, `values` and `mean`.
///
/// ```
/// vg_geometry::measures! {
///     /// How good a car is.
///     #[derive(Clone, Copy, Debug, PartialEq)]
///     pub struct Car {
///         /// Metres per second.
///         pub speed: f64 => ("m/s", 1, Higher),
///         /// Litres; `None` of electric cars.
///         pub fuel: Option<f64> => ("l", 1, Lower),
///     }
/// }
/// let mean = Car::mean(&[Car { speed: 1.0, fuel: None }, Car { speed: 3.0, fuel: Some(5.0) }]);
/// assert_eq!(mean, Some(Car { speed: 2.0, fuel: Some(5.0) }));
/// assert_eq!(Car::MEASURES[1].title, "l");
/// ```
#[macro_export]
macro_rules! measures {
    (
        $(#[$meta:meta])*
        pub struct $Type:ident {
            $( $(#[$($field_meta:tt)*])* pub $field:ident : $type:ty =>
                ($title:literal, $digits:literal, $better:ident) ),+ $(,)?
        }
    ) => {
        $(#[$meta])*
        pub struct $Type {
            $( $(#[$($field_meta)*])* pub $field: $type, )+
        }

        impl $Type {
            /// The measures, in the order of the struct.
            pub const MEASURES: &'static [$crate::measures::Measure] = &[$( $crate::measures::Measure {
                name: stringify!($field),
                doc: &[$( $crate::doc_line!($($field_meta)*) ),*],
                title: $title,
                digits: $digits,
                better: $crate::measures::Better::$better,
                may_lack: <$type as $crate::measures::MeasureValue>::MAY_LACK,
            } ),+];

            /// The numbers, in the order of [`Self::MEASURES`].
            pub fn values(&self) -> Vec<Option<f64>> {
                vec![$( $crate::measures::MeasureValue::number(self.$field) ),+]
            }

            /// Means, each measure over those that have it, of absolute values where the best is 0; `None` of nothing.
            pub fn mean(all: &[Self]) -> Option<Self> {
                let mut measures = Self::MEASURES.iter();
                Some(Self { $( $field: {
                    let numbers = all.iter().map(|one| $crate::measures::MeasureValue::number(one.$field));
                    $crate::measures::MeasureValue::from_number(
                        $crate::measures::mean_of(measures.next()?, numbers),
                    )?
                }, )+ })
            }
        }
    };
}
