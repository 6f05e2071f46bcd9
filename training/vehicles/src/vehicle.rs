//! Parametric vehicles: nine classes, each a family of shapes.
//!
//! A vehicle is its own mirror image in y = 0; here the ground is z = 0 and x = 0 lies half way between the
//! bumpers. It consists of a lower body (a profile from the side, a plan, and a section with rocker, belly and
//! shoulder), a cabin or box on it, wheels in their arches, and parts that stick out.

use crate::solid::{Curve, ellipsoid, right_of, rounded_box, smooth_max, smooth_min};
use glam::{Vec2, Vec3};
use rand::Rng;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    Sedan,
    Hatchback,
    Estate,
    Suv,
    Sports,
    Pickup,
    Van,
    BoxTruck,
    Bus,
}

/// Relative frequency of each class.
pub const CLASSES: [(Class, f32); 9] = [
    (Class::Sedan, 0.15),
    (Class::Hatchback, 0.16),
    (Class::Estate, 0.09),
    (Class::Suv, 0.18),
    (Class::Sports, 0.07),
    (Class::Pickup, 0.12),
    (Class::Van, 0.11),
    (Class::BoxTruck, 0.08),
    (Class::Bus, 0.04),
];

/// A lower body: bonnet, wings, doors up to the belt line, boot.
struct Lower {
    top: Curve,
    half_width: f32,
    /// Ends of the body, and the rounding of the plan towards them: depth and exponent.
    front: f32,
    rear: f32,
    front_round: Vec2,
    rear_round: Vec2,
    /// Inclination of the fascias: metres back per metre above and below the height of the bumpers.
    front_lean: Vec2,
    rear_lean: Vec2,
    bumper_z: f32,
    clearance: f32,
    /// Rise of the underside at the ends, metres.
    overhang_rise: f32,
    /// Inclination of the side towards the rocker and the shoulder, metres per metre squared.
    tuck: f32,
    shoulder: f32,
    belly_z: f32,
    /// Drop of the bonnet at its sides, metres.
    crown: f32,
    fillet: f32,
}

/// A cabin, or the box of a van: planes leaning inwards, a curved roof.
struct Cabin {
    /// (x, z) of the windscreen's foot and top, and the rear window's top and foot.
    side: [Vec2; 4],
    screen_curve: f32,
    rear_curve: f32,
    half_width: f32,
    belt: f32,
    /// Metres inwards per metre of height.
    tumblehome: f32,
    /// Narrowing towards its ends.
    taper: f32,
    roof_curve: f32,
    roof_crown: f32,
    floor: f32,
    fillet: f32,
}

struct Wheels {
    axles: Vec<f32>,
    radius: f32,
    width: f32,
    /// Outer face of the tyres.
    outer: f32,
    arch: f32,
    arch_depth: f32,
    /// Width and height of the lip around the arch.
    flare: f32,
}

enum Part {
    Box {
        center: Vec3,
        half: Vec3,
        radius: f32,
        blend: f32,
    },
    Ellipsoid {
        center: Vec3,
        half: Vec3,
    },
    /// A volume cut out of all earlier parts.
    Hollow {
        center: Vec3,
        half: Vec3,
        radius: f32,
    },
}

struct Wave {
    direction: Vec3,
    phase: f32,
    height: f32,
}

pub struct Vehicle {
    pub class: Class,
    /// Corners of its bounding box, x and z; |y| up to `high.y`.
    pub low: Vec3,
    pub high: Vec3,
    lower: Lower,
    cabin: Option<Cabin>,
    blend: f32,
    wheels: Wheels,
    parts: Vec<Part>,
    waves: Vec<Wave>,
}

impl Vehicle {
    /// The implicit function: positive inside, about the distance in metres.
    pub fn inside(&self, p: Vec3) -> f32 {
        let p = Vec3::new(p.x, p.y.abs(), p.z);
        let mut f = self.lower.inside(p);
        if let Some(cabin) = &self.cabin {
            f = smooth_max(f, cabin.inside(p), self.blend);
        }
        // Real panels are never exactly described by a few numbers.
        f += self.waves.iter().map(|w| w.height * (w.direction.dot(p) + w.phase).sin()).sum::<f32>();
        f = self.wheels.cut(p, f);
        for part in &self.parts {
            match part {
                Part::Box { center, half, radius, blend } => {
                    f = smooth_max(f, rounded_box(p, *center, *half, *radius), *blend);
                }
                Part::Ellipsoid { center, half } => f = f.max(ellipsoid(p, *center, *half)),
                Part::Hollow { center, half, radius } => {
                    f = f.min(-rounded_box(p, *center, *half, *radius));
                }
            }
        }
        f.max(self.wheels.inside(p))
    }
}

impl Lower {
    fn inside(&self, p: Vec3) -> f32 {
        let (x, a, z) = (p.x, p.y, p.z);
        let relative = a / self.half_width;
        let above = (z - self.belly_z).max(0.0);
        let below = (self.belly_z - z).max(0.0);
        let side = self.half_width - self.tuck * below * below - self.shoulder * above * above - a;
        let top = self.top.at(x) - self.crown * relative * relative - z;
        let lean = |lean: Vec2| {
            let d = z - self.bumper_z;
            if d > 0.0 { lean.x * d } else { -lean.y * d }
        };
        let front = self.front
            - self.front_round.x * relative.min(1.2).powf(self.front_round.y)
            - lean(self.front_lean)
            - x;
        let rear = x
            - self.rear
            - self.rear_round.x * relative.min(1.2).powf(self.rear_round.y)
            - lean(self.rear_lean);
        let end = (2.0 * x.abs() / (self.front - self.rear)).min(1.2);
        let bottom = z - self.clearance - self.overhang_rise * end.powi(6);
        let k = self.fillet;
        smooth_min(smooth_min(smooth_min(smooth_min(side, top, k), front, k), rear, k), bottom, 0.04)
    }
}

impl Cabin {
    fn inside(&self, p: Vec3) -> f32 {
        let (x, a, z) = (p.x, p.y, p.z);
        let [foot, top, rear_top, rear_foot] = self.side;
        let curve = a * a;
        let screen = right_of(Vec2::new(x + self.screen_curve * curve, z), top, foot);
        let rear = right_of(Vec2::new(x - self.rear_curve * curve, z), rear_foot, rear_top);
        let middle = 0.5 * (top.x + rear_top.x);
        let half_length = 0.5 * (foot.x - rear_foot.x);
        let along = (x - middle) / half_length.max(0.2);
        let relative = a / self.half_width;
        let t = ((x - rear_top.x) / (top.x - rear_top.x).max(0.1)).clamp(-0.3, 1.3);
        let ridge = rear_top.y + (top.y - rear_top.y) * t + self.roof_curve * (1.0 - (2.0 * t - 1.0).powi(2));
        let roof = ridge - self.roof_crown * relative * relative - z;
        let side = (self.half_width - self.tumblehome * (z - self.belt) - self.taper * along * along - a)
            / (1.0 + self.tumblehome * self.tumblehome).sqrt();
        let k = self.fillet;
        let f = smooth_min(smooth_min(smooth_min(side, roof, k), screen, k), rear, k);
        f.min(z - self.floor)
    }
}

impl Wheels {
    fn radial(&self, p: Vec3) -> f32 {
        let near = |x: &f32| (p.x - x).hypot(p.z - self.radius);
        self.axles.iter().map(near).fold(f32::INFINITY, f32::min)
    }

    /// Cuts the arches out of the body and adds lips around them.
    fn cut(&self, p: Vec3, f: f32) -> f32 {
        let rho = self.radial(p);
        let lip =
            (self.flare - (rho - self.arch - self.flare).abs()).min(self.outer + 0.5 * self.flare - p.y);
        // A lip follows the edge of the body, not the air below it.
        let lip = lip.min(p.y - self.outer + 0.1).min(f + 0.05);
        let f = if self.flare > 0.0 { smooth_max(f, lip, 0.04) } else { f };
        f.min(-(self.arch - rho).min(p.y - (self.outer - self.arch_depth)))
    }

    fn inside(&self, p: Vec3) -> f32 {
        let half = 0.5 * self.width;
        let across = half - (p.y - (self.outer - half)).abs();
        smooth_min(self.radius - self.radial(p), across, 0.05)
    }
}

/// A random vehicle.
pub fn draw(rng: &mut impl Rng) -> Vehicle {
    let total: f32 = CLASSES.iter().map(|c| c.1).sum();
    let mut pick = rng.random::<f32>() * total;
    let class = CLASSES.iter().find(|(_, p)| {
        pick -= p;
        pick <= 0.0
    });
    draw_class(class.map_or(Class::Sedan, |c| c.0), rng)
}

/// A random vehicle of this class.
pub fn draw_class(class: Class, rng: &mut impl Rng) -> Vehicle {
    Draft::new(class, rng).vehicle(rng)
}

/// The basic proportions.
struct Draft {
    class: Class,
    length: f32,
    width: f32,
    height: f32,
    clearance: f32,
    wheel_radius: f32,
    belt: f32,
}

/// Ranges of length, width, height, ground clearance and wheel radius, metres.
fn ranges(class: Class) -> [(f32, f32); 5] {
    match class {
        Class::Sedan => [(4.2, 5.3), (1.68, 1.95), (1.36, 1.56), (0.12, 0.20), (0.29, 0.36)],
        Class::Hatchback => [(3.4, 4.5), (1.58, 1.88), (1.38, 1.62), (0.12, 0.20), (0.27, 0.35)],
        Class::Estate => [(4.2, 5.1), (1.68, 1.95), (1.40, 1.62), (0.12, 0.22), (0.29, 0.37)],
        Class::Suv => [(3.9, 5.3), (1.74, 2.12), (1.55, 2.05), (0.17, 0.30), (0.32, 0.44)],
        Class::Sports => [(3.9, 4.8), (1.70, 2.02), (1.10, 1.36), (0.09, 0.15), (0.30, 0.37)],
        Class::Pickup => [(4.7, 6.1), (1.74, 2.14), (1.60, 2.05), (0.19, 0.36), (0.33, 0.46)],
        Class::Van => [(3.9, 6.9), (1.72, 2.14), (1.70, 2.85), (0.15, 0.26), (0.30, 0.38)],
        Class::BoxTruck => [(4.8, 9.0), (1.9, 2.5), (2.0, 3.7), (0.22, 0.42), (0.34, 0.52)],
        Class::Bus => [(6.5, 13.0), (2.1, 2.58), (2.5, 3.5), (0.18, 0.34), (0.40, 0.52)],
    }
}

impl Draft {
    fn new(class: Class, rng: &mut impl Rng) -> Self {
        let [length, width, height, clearance, wheel_radius] =
            ranges(class).map(|(a, b)| rng.random_range(a..b));
        let belt_share = match class {
            Class::Van => rng.random_range(0.40..0.58),
            Class::BoxTruck | Class::Bus => rng.random_range(0.35..0.5),
            Class::Suv | Class::Pickup => rng.random_range(0.56..0.68),
            _ => rng.random_range(0.58..0.70),
        };
        Self { class, length, width, height, clearance, wheel_radius, belt: belt_share * height }
    }

    fn vehicle(&self, rng: &mut impl Rng) -> Vehicle {
        let (front, rear) = (0.5 * self.length, -0.5 * self.length);
        let hw = 0.5 * self.width;
        let mut parts = Vec::new();
        let wheels = self.wheels(rng);
        let (lower, cabin) = match self.class {
            Class::Bus => (self.bus(rng), None),
            Class::BoxTruck => {
                let (lower, cabin) = self.box_truck(rng, &mut parts);
                (lower, Some(cabin))
            }
            _ => {
                let (foot, cabin) = self.cabin(rng, &mut parts);
                let lower = self.lower(rng, foot, &cabin);
                // The windows are on the shoulder, not beyond it.
                let shoulder = lower.shoulder * (self.belt - lower.belly_z).max(0.0).powi(2);
                (lower, Some(Cabin { half_width: cabin.half_width - shoulder, ..cabin }))
            }
        };
        self.bumpers(rng, &mut parts);
        self.roof_parts(rng, cabin.as_ref(), &mut parts);
        let mirror_out = self.mirrors(rng, &lower, cabin.as_ref(), &mut parts);
        let waves = (0..4)
            .map(|_| {
                let length = rng.random_range(0.6..2.8f32);
                let direction = Vec3::new(
                    rng.random_range(-1.0..1.0),
                    rng.random_range(-1.0..1.0),
                    rng.random_range(-1.0..1.0f32),
                );
                Wave {
                    direction: direction.normalize_or(Vec3::X) * std::f32::consts::TAU / length,
                    phase: rng.random_range(0.0..std::f32::consts::TAU),
                    height: rng.random_range(0.0..0.012) * length.min(1.5),
                }
            })
            .collect();
        Vehicle {
            class: self.class,
            low: Vec3::new(rear - 0.5, 0.0, -0.05),
            high: Vec3::new(front + 0.4, hw.max(mirror_out) + 0.12, self.height + 0.6),
            blend: rng.random_range(0.02..0.10),
            lower,
            cabin,
            wheels,
            parts,
            waves,
        }
    }

    fn wheels(&self, rng: &mut impl Rng) -> Wheels {
        let heavy = matches!(self.class, Class::BoxTruck | Class::Bus);
        let rugged = heavy || matches!(self.class, Class::Suv | Class::Pickup);
        let radius = self.wheel_radius;
        let front_overhang = match self.class {
            Class::Bus => rng.random_range(0.2..0.27) * self.length,
            Class::BoxTruck => rng.random_range(0.9..1.4),
            _ => radius + rng.random_range(0.32..0.65),
        };
        let rear_overhang = match self.class {
            Class::Bus => rng.random_range(0.18..0.3) * self.length,
            Class::BoxTruck => rng.random_range(0.16..0.3) * self.length,
            Class::Pickup => radius + rng.random_range(0.6..1.0),
            Class::Hatchback => radius + rng.random_range(0.15..0.5),
            _ => radius + rng.random_range(0.3..0.8),
        };
        let mut axles = vec![0.5 * self.length - front_overhang, -0.5 * self.length + rear_overhang];
        if heavy && rng.random_bool(0.25) {
            axles.push(axles[1] + 2.1 * radius);
        }
        Wheels {
            axles,
            radius,
            width: rng.random_range(0.18..0.30) + if heavy { 0.1 } else { 0.0 },
            outer: 0.5 * self.width - rng.random_range(if rugged { -0.10 } else { -0.02 }..0.08),
            arch: radius + rng.random_range(0.03..if rugged { 0.22 } else { 0.11 }),
            arch_depth: rng.random_range(0.25..0.6),
            flare: if rng.random_bool(0.35) { rng.random_range(0.01..0.05) } else { 0.0 },
        }
    }

    /// The cabin of everything with a bonnet or a van's nose, and the foot of its windscreen.
    fn cabin(&self, rng: &mut impl Rng, parts: &mut Vec<Part>) -> (Vec2, Cabin) {
        let (l, h, belt) = (self.length, self.height, self.belt);
        let front = 0.5 * l;
        let bonnet = match self.class {
            Class::Sedan | Class::Estate => rng.random_range(0.21..0.29) * l,
            Class::Sports => rng.random_range(0.22..0.38) * l,
            Class::Hatchback => rng.random_range(0.17..0.26) * l,
            Class::Suv => rng.random_range(0.19..0.29) * l,
            Class::Pickup => rng.random_range(0.19..0.26) * l,
            _ => rng.random_range(0.05..0.22) * l.min(5.5),
        };
        // Rakes are horizontal length over height, so that low roofs get long windscreens.
        let screen_run = match self.class {
            Class::Suv | Class::Pickup => rng.random_range(0.55..1.5),
            Class::Van => rng.random_range(0.35..1.3),
            _ => rng.random_range(1.1..2.1),
        };
        let rear_run = match self.class {
            Class::Sedan => rng.random_range(1.0..2.4),
            Class::Sports => rng.random_range(1.2..3.0),
            Class::Hatchback => rng.random_range(0.25..1.3),
            Class::Estate => rng.random_range(0.3..1.0),
            Class::Suv => rng.random_range(0.08..0.9),
            Class::Pickup => rng.random_range(0.02..0.5),
            _ => rng.random_range(0.0..0.15),
        };
        let cowl = belt + rng.random_range(-0.08..0.06);
        let rise = h - cowl;
        let foot = Vec2::new(front - bonnet, cowl);
        let top_z = h - rng.random_range(0.0..0.08);
        let top = Vec2::new(foot.x - screen_run * (top_z - cowl), top_z);
        let rear_edge = match self.class {
            Class::Sedan => -0.5 * l + rng.random_range(0.08..0.17) * l,
            Class::Sports => -0.5 * l + rng.random_range(0.03..0.16) * l,
            Class::Pickup => -0.5 * l + rng.random_range(0.22..0.45) * l,
            _ => -0.5 * l + rng.random_range(0.0..0.03) * l,
        };
        let rear_z =
            h - rng.random_range(0.0..0.12) * if matches!(self.class, Class::Van) { 0.3 } else { 1.0 };
        let rear_foot_z = belt + rng.random_range(-0.05..0.15);
        let rear_top_x = (rear_edge + rear_run * (rear_z - rear_foot_z)).min(top.x - 0.25);
        let rear_top = Vec2::new(rear_top_x, rear_z);
        let rear_foot = Vec2::new(rear_edge.min(rear_top_x - 0.01), rear_foot_z);
        let boxy = matches!(self.class, Class::Van);
        let half_width = 0.5 * self.width - rng.random_range(0.0..if boxy { 0.03 } else { 0.08 });
        if self.class == Class::Pickup {
            self.bed(rng, rear_edge, parts);
        }
        let cabin = Cabin {
            side: [foot, top, rear_top, rear_foot],
            screen_curve: rng.random_range(0.05..0.35),
            rear_curve: if boxy { rng.random_range(0.0..0.06) } else { rng.random_range(0.0..0.25) },
            half_width,
            belt,
            tumblehome: if boxy { rng.random_range(0.02..0.22) } else { rng.random_range(0.15..0.52) },
            taper: rng.random_range(0.0..if boxy { 0.04 } else { 0.16 }),
            roof_curve: rng.random_range(0.0..0.08f32).min(0.15 * rise),
            roof_crown: rng.random_range(0.01..0.09),
            floor: foot.y.min(rear_foot.y) - 0.06,
            fillet: rng.random_range(0.06..0.28),
        };
        (foot, cabin)
    }

    fn lower(&self, rng: &mut impl Rng, foot: Vec2, cabin: &Cabin) -> Lower {
        let (l, h, belt) = (self.length, self.height, self.belt);
        let front = 0.5 * l;
        let van = matches!(self.class, Class::Van);
        let nose_z = if van {
            rng.random_range(0.55..0.95) * foot.y.min(1.2)
        } else {
            rng.random_range(0.66..0.95) * foot.y
        };
        let bonnet = front - foot.x;
        let deck_z = match self.class {
            Class::Sedan => belt + rng.random_range(-0.02..0.14),
            Class::Sports => belt + rng.random_range(-0.05..0.12),
            Class::Pickup => belt + rng.random_range(-0.12..0.10),
            _ => belt + rng.random_range(-0.02..0.10),
        };
        let rear_foot = cabin.side[3];
        let mut points = vec![
            Vec2::new(-front, deck_z - rng.random_range(0.0..0.10)),
            Vec2::new((-front + 0.06 * l).min(rear_foot.x - 0.02), deck_z),
            Vec2::new(rear_foot.x.max(-front + 0.07 * l), deck_z + rng.random_range(0.0..0.03)),
            Vec2::new((foot.x - 0.3).min(0.0), belt),
            Vec2::new(foot.x, foot.y),
            Vec2::new(foot.x + 0.55 * bonnet, nose_z + rng.random_range(0.45..0.9) * (foot.y - nose_z)),
            Vec2::new(front, nose_z),
        ];
        points.sort_by(|a, b| a.x.total_cmp(&b.x));
        points.dedup_by(|a, b| (a.x - b.x).abs() < 0.02);
        let square = if matches!(self.class, Class::Suv | Class::Pickup | Class::Van) { 0.7 } else { 1.0 };
        Lower {
            top: Curve::through(points),
            half_width: 0.5 * self.width,
            front,
            rear: -front,
            front_round: Vec2::new(square * rng.random_range(0.12..0.62), rng.random_range(2.0..4.5)),
            rear_round: Vec2::new(square * rng.random_range(0.04..0.42), rng.random_range(2.2..5.0)),
            front_lean: Vec2::new(rng.random_range(0.02..0.5), rng.random_range(0.0..0.45)),
            rear_lean: Vec2::new(rng.random_range(-0.05..0.3), rng.random_range(0.0..0.45)),
            bumper_z: rng.random_range(0.3..0.4) * h.min(1.9),
            clearance: self.clearance,
            overhang_rise: rng.random_range(0.0..0.12),
            tuck: rng.random_range(0.0..0.6),
            shoulder: rng.random_range(0.0..0.55),
            belly_z: self.clearance + rng.random_range(0.3..0.65) * (belt - self.clearance),
            crown: rng.random_range(0.0..0.12),
            fillet: rng.random_range(0.05..0.22),
        }
    }

    /// An open bed behind the cab, or a closed one.
    fn bed(&self, rng: &mut impl Rng, cab_rear: f32, parts: &mut Vec<Part>) {
        let rear = -0.5 * self.length;
        if rng.random_bool(0.2) {
            // A canopy or a load.
            let top = rng.random_range(self.belt + 0.05..self.height + 0.05);
            let middle = 0.5 * (cab_rear + rear);
            parts.push(Part::Box {
                center: Vec3::new(middle, 0.0, 0.5 * (top + self.belt - 0.2)),
                half: Vec3::new(
                    0.5 * (cab_rear - rear) - 0.03,
                    0.5 * self.width - 0.12,
                    0.5 * (top - self.belt + 0.2),
                ),
                radius: 0.06,
                blend: 0.02,
            });
            return;
        }
        if rng.random_bool(0.12) {
            return;
        }
        let floor = self.belt - rng.random_range(0.35..0.55);
        let (from, to) = (rear + rng.random_range(0.05..0.12), cab_rear - rng.random_range(0.02..0.10));
        parts.push(Part::Hollow {
            center: Vec3::new(0.5 * (from + to), 0.0, floor + 1.0),
            half: Vec3::new(0.5 * (to - from).max(0.2), 0.5 * self.width - rng.random_range(0.07..0.18), 1.0),
            radius: 0.03,
        });
        if rng.random_bool(0.2) {
            let x = to - 0.08;
            let top = rng.random_range(self.belt + 0.2..self.height + 0.03);
            parts.push(Part::Box {
                center: Vec3::new(x, 0.5 * self.width - 0.25, 0.5 * (top + self.belt - 0.1)),
                half: Vec3::new(0.04, 0.05, 0.5 * (top - self.belt + 0.1)),
                radius: 0.03,
                blend: 0.01,
            });
            parts.push(Part::Box {
                center: Vec3::new(x, 0.0, top),
                half: Vec3::new(0.04, 0.5 * self.width - 0.2, 0.04),
                radius: 0.03,
                blend: 0.01,
            });
        }
    }

    fn bus(&self, rng: &mut impl Rng) -> Lower {
        let front = 0.5 * self.length;
        let roof = self.height;
        Lower {
            top: Curve::through(vec![
                Vec2::new(-front, roof - rng.random_range(0.0..0.2)),
                Vec2::new(-0.8 * front, roof),
                Vec2::new(0.8 * front, roof),
                Vec2::new(front, roof - rng.random_range(0.0..0.3)),
            ]),
            half_width: 0.5 * self.width,
            front,
            rear: -front,
            front_round: Vec2::new(rng.random_range(0.05..0.5), rng.random_range(2.2..5.0)),
            rear_round: Vec2::new(rng.random_range(0.02..0.25), rng.random_range(2.5..6.0)),
            front_lean: Vec2::new(rng.random_range(0.0..0.22), rng.random_range(0.0..0.15)),
            rear_lean: Vec2::new(rng.random_range(0.0..0.06), rng.random_range(0.0..0.2)),
            bumper_z: rng.random_range(0.4..1.0),
            clearance: self.clearance,
            overhang_rise: rng.random_range(0.0..0.1),
            tuck: rng.random_range(0.0..0.1),
            shoulder: rng.random_range(0.0..0.05),
            belly_z: rng.random_range(0.8..1.4),
            crown: rng.random_range(0.0..0.12),
            fillet: rng.random_range(0.05..0.35),
        }
    }

    /// A cab of its own width and height, and a box behind it on a frame.
    fn box_truck(&self, rng: &mut impl Rng, parts: &mut Vec<Part>) -> (Lower, Cabin) {
        let front = 0.5 * self.length;
        let cab_height = (self.height * rng.random_range(0.68..0.95)).clamp(1.6, 2.8);
        let cab_length =
            rng.random_range(1.5..2.3) + if rng.random_bool(0.4) { rng.random_range(0.3..0.9) } else { 0.0 };
        let cab = Draft {
            length: cab_length * 2.0,
            height: cab_height,
            belt: rng.random_range(0.48..0.6) * cab_height,
            ..*self
        };
        let width = self.width - rng.random_range(0.0..0.35);
        let bonnet = rng.random_range(0.02..0.45) * (cab_length - 1.2).max(0.3);
        let cowl = cab.belt + rng.random_range(-0.1..0.1);
        let foot = Vec2::new(front - bonnet, cowl);
        let top = Vec2::new(foot.x - rng.random_range(0.08..0.8) * (cab_height - cowl), cab_height);
        let rear_x = front - cab_length;
        let cabin = Cabin {
            side: [
                foot,
                top,
                Vec2::new(rear_x.min(top.x - 0.3), cab_height),
                Vec2::new(rear_x.min(top.x - 0.3), cowl),
            ],
            screen_curve: rng.random_range(0.02..0.25),
            rear_curve: 0.0,
            half_width: 0.5 * width,
            belt: cab.belt,
            tumblehome: rng.random_range(0.02..0.2),
            taper: 0.0,
            roof_curve: rng.random_range(0.0..0.05),
            roof_crown: rng.random_range(0.0..0.08),
            floor: cowl - 0.1,
            fillet: rng.random_range(0.05..0.2),
        };
        let frame_z = rng.random_range(0.7..1.05);
        let nose_z = rng.random_range(0.6..0.98) * cowl;
        let lower = Lower {
            top: Curve::through(vec![
                Vec2::new(-front, frame_z),
                Vec2::new(rear_x - 0.05, frame_z),
                Vec2::new(rear_x + 0.05, cowl),
                Vec2::new(foot.x, cowl),
                Vec2::new(front, nose_z),
            ]),
            half_width: 0.5 * width,
            front,
            rear: -front,
            front_round: Vec2::new(rng.random_range(0.05..0.4), rng.random_range(2.2..5.0)),
            rear_round: Vec2::new(0.02, 4.0),
            front_lean: Vec2::new(rng.random_range(0.0..0.25), rng.random_range(0.0..0.2)),
            rear_lean: Vec2::new(0.0, rng.random_range(0.0..0.5)),
            bumper_z: rng.random_range(0.45..0.7),
            clearance: self.clearance + 0.1,
            overhang_rise: 0.05,
            tuck: rng.random_range(0.0..0.2),
            shoulder: 0.0,
            belly_z: 0.9,
            crown: 0.02,
            fillet: 0.06,
        };
        let gap = rng.random_range(0.0..0.25);
        let (from, to) = (-front, rear_x - gap);
        let floor = frame_z - rng.random_range(0.0..0.15);
        let flat = rng.random_bool(0.12);
        let roof = if flat { floor + 0.25 } else { self.height };
        parts.push(Part::Box {
            center: Vec3::new(0.5 * (from + to), 0.0, 0.5 * (floor + roof)),
            half: Vec3::new(0.5 * (to - from), 0.5 * self.width, 0.5 * (roof - floor)),
            radius: rng.random_range(0.01..0.1),
            blend: 0.02,
        });
        (lower, cabin)
    }

    fn bumpers(&self, rng: &mut impl Rng, parts: &mut Vec<Part>) {
        for end in [1.0f32, -1.0] {
            if rng.random_bool(0.35) {
                let z = rng.random_range(0.38..0.6) + 0.5 * (self.clearance - 0.15);
                let reach = rng.random_range(0.12..0.26);
                let beyond = rng.random_range(-0.05..0.06);
                parts.push(Part::Box {
                    center: Vec3::new(end * (0.5 * self.length - reach + beyond), 0.0, z),
                    half: Vec3::new(
                        reach,
                        0.5 * self.width - rng.random_range(0.05..0.28),
                        rng.random_range(0.06..0.16),
                    ),
                    radius: 0.06,
                    blend: rng.random_range(0.01..0.08),
                });
            }
        }
        if rng.random_bool(0.15) {
            // Running boards.
            parts.push(Part::Box {
                center: Vec3::new(0.0, 0.5 * self.width - 0.06, self.clearance + 0.06),
                half: Vec3::new(0.2 * self.length, 0.08, 0.03),
                radius: 0.02,
                blend: 0.01,
            });
        }
    }

    fn roof_parts(&self, rng: &mut impl Rng, cabin: Option<&Cabin>, parts: &mut Vec<Part>) {
        let Some(cabin) = cabin else {
            if rng.random_bool(0.4) {
                parts.push(Part::Box {
                    center: Vec3::new(rng.random_range(-0.3..0.3) * self.length, 0.0, self.height + 0.05),
                    half: Vec3::new(
                        rng.random_range(0.5..1.8),
                        rng.random_range(0.4..0.9),
                        rng.random_range(0.08..0.2),
                    ),
                    radius: 0.07,
                    blend: 0.03,
                });
            }
            return;
        };
        let (front, rear) = (cabin.side[1], cabin.side[2]);
        let roof = 0.5 * (front.y + rear.y);
        let half = cabin.half_width - cabin.tumblehome * (roof - cabin.belt);
        let length = front.x - rear.x;
        let middle = 0.5 * (front.x + rear.x);
        if rng.random_bool(0.22) {
            // Rails along the roof.
            parts.push(Part::Box {
                center: Vec3::new(middle, half - rng.random_range(0.06..0.14), roof + cabin.roof_curve * 0.5),
                half: Vec3::new(0.45 * length, 0.025, rng.random_range(0.04..0.09)),
                radius: 0.02,
                blend: 0.01,
            });
        }
        if rng.random_bool(0.12) {
            // A light bar, a taxi sign, a cooling unit, a roof box.
            let half_x: f32 =
                if rng.random_bool(0.5) { rng.random_range(0.08..0.2) } else { rng.random_range(0.3..0.9) };
            parts.push(Part::Box {
                center: Vec3::new(
                    rear.x + rng.random_range(0.15..0.9) * length,
                    0.0,
                    roof + rng.random_range(-0.02..0.1),
                ),
                half: Vec3::new(
                    half_x.min(0.45 * length),
                    rng.random_range(0.15..0.95) * half,
                    rng.random_range(0.05..0.18),
                ),
                radius: 0.04,
                blend: 0.01,
            });
        }
        if matches!(self.class, Class::Hatchback | Class::Suv | Class::Sports | Class::Estate)
            && rng.random_bool(0.3)
        {
            // A spoiler at the roof's end.
            parts.push(Part::Box {
                center: Vec3::new(
                    rear.x - rng.random_range(0.0..0.12),
                    0.0,
                    rear.y - rng.random_range(0.0..0.06),
                ),
                half: Vec3::new(rng.random_range(0.08..0.2), 0.85 * half, 0.025),
                radius: 0.02,
                blend: 0.04,
            });
        }
        if self.class == Class::Suv && rng.random_bool(0.12) {
            // A spare wheel on the tailgate.
            parts.push(Part::Box {
                center: Vec3::new(-0.5 * self.length - 0.02, 0.0, 0.55 * self.height),
                half: Vec3::new(0.13, self.wheel_radius, self.wheel_radius),
                radius: 0.12,
                blend: 0.02,
            });
        }
    }

    /// Adds two mirrors. Returns their distance from the middle.
    fn mirrors(
        &self,
        rng: &mut impl Rng,
        lower: &Lower,
        cabin: Option<&Cabin>,
        parts: &mut Vec<Part>,
    ) -> f32 {
        let heavy = matches!(self.class, Class::BoxTruck | Class::Bus);
        let (x, z, at) = match cabin {
            Some(cabin) => {
                let [foot, top, ..] = cabin.side;
                let z = cabin.belt + rng.random_range(0.02..0.18) + if heavy { 0.3 } else { 0.0 };
                let t = ((z - foot.y) / (top.y - foot.y).max(0.1)).clamp(0.0, 1.0);
                let x = foot.x + (top.x - foot.x) * t - rng.random_range(0.05..0.35);
                (x, z, cabin.half_width - cabin.tumblehome * (z - cabin.belt).max(0.0))
            }
            None => (lower.front - rng.random_range(-0.1..0.4), rng.random_range(1.5..2.2), lower.half_width),
        };
        let size = if heavy {
            Vec3::new(rng.random_range(0.05..0.12), rng.random_range(0.08..0.16), rng.random_range(0.12..0.3))
        } else {
            Vec3::new(
                rng.random_range(0.05..0.13),
                rng.random_range(0.08..0.14),
                rng.random_range(0.05..0.11),
            )
        };
        let y = at + size.y + rng.random_range(-0.02..0.08);
        if rng.random_bool(0.93) {
            parts.push(Part::Ellipsoid { center: Vec3::new(x, y, z), half: size });
            parts.push(Part::Box {
                center: Vec3::new(x, at, z - 0.4 * size.z),
                half: Vec3::new(0.03, (y - at).max(0.05), 0.025),
                radius: 0.02,
                blend: 0.01,
            });
        }
        y + size.y
    }
}
