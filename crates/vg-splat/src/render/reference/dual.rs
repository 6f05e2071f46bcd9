//! Number types of the projection: f64, or f64 with its derivatives (forward mode).

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Operations that the projection needs.
pub(super) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    fn constant(v: f64) -> Self;
    fn value(self) -> f64;
    fn sqrt(self) -> Self;
}

impl Number for f64 {
    fn constant(v: f64) -> Self {
        v
    }

    fn value(self) -> f64 {
        self
    }

    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
}

/// A value and its derivatives by N variables.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dual<const N: usize> {
    pub(super) value: f64,
    pub(super) by: [f64; N],
}

impl<const N: usize> Dual<N> {
    /// The variable number `i`.
    pub(super) fn variable(value: f64, i: usize) -> Self {
        let mut by = [0.0; N];
        by[i] = 1.0;
        Self { value, by }
    }

    /// `value` with derivative `a self.by + b other.by`.
    fn chain(self, value: f64, a: f64, other: Self, b: f64) -> Self {
        let mut by = [0.0; N];
        for i in 0..N {
            by[i] = a * self.by[i] + b * other.by[i];
        }
        Self { value, by }
    }
}

impl<const N: usize> Number for Dual<N> {
    fn constant(value: f64) -> Self {
        Self { value, by: [0.0; N] }
    }

    fn value(self) -> f64 {
        self.value
    }

    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, 0.5 / root, self, 0.0)
    }
}

impl<const N: usize> Add for Dual<N> {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        self.chain(self.value + o.value, 1.0, o, 1.0)
    }
}

impl<const N: usize> Sub for Dual<N> {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self.chain(self.value - o.value, 1.0, o, -1.0)
    }
}

impl<const N: usize> Mul for Dual<N> {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        self.chain(self.value * o.value, o.value, o, self.value)
    }
}

impl<const N: usize> Div for Dual<N> {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        let value = self.value / o.value;
        self.chain(value, 1.0 / o.value, o, -value / o.value)
    }
}

impl<const N: usize> Neg for Dual<N> {
    type Output = Self;
    fn neg(self) -> Self {
        self.chain(-self.value, -1.0, self, 0.0)
    }
}
