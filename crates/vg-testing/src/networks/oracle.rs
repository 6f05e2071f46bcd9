//! Graphs that compute exact depth of the ellipsoid of `crate::vehicle` from intrinsics and relative poses, in every
//! convention that the contract has.

use super::graph::{Attribute, Graph, Port};
use crate::vehicle::HALF;
use glam::DMat3;
use vg::Camera;

/// The convention of a network that contains the exact shape.
#[derive(Clone, Copy, Debug)]
pub struct Manner {
    pub along_ray: bool,
    pub is_metric: bool,
    /// Its unit in metres: depth and translations are divided by it, and `scale` is the unit if the network is metric.
    pub unit: f32,
}

impl Manner {
    pub const PLAIN: Self = Self { along_ray: false, is_metric: true, unit: 1.0 };
}

/// A network for pictures of `width` x `height` whose first view is `first`.
pub fn ellipsoid(first: &Camera, width: u64, height: u64, manner: Manner) -> Graph {
    let mut g = Graph::default();
    let (n, w, h) = (None, Some(width), Some(height));
    g.inputs = vec![
        Port::new("images", &[n, Some(3), h, w]),
        Port::new("intrinsics", &[n, Some(3), Some(3)]),
        Port::new("cam_to_ref", &[n, Some(4), Some(4)]),
    ];
    g.outputs = vec![
        Port::new("depth", &[n, h, w]),
        Port::new("rays", &[n, h, w, Some(3)]),
        Port::new("mask", &[n, h, w]),
        Port::new("confidence", &[n, h, w]),
        Port::new("scale", &[Some(1)]),
        Port::new("cam_to_ref_pred", &[n, Some(4), Some(4)]),
    ];
    let yes = |b: bool| if b { "true" } else { "false" };
    g.say("vg.contract", "1").say("vg.prior", "oracle").say("vg.metric", yes(manner.is_metric));
    g.say("vg.depth", if manner.along_ray { "along_ray" } else { "z" });

    // Rays with z = 1, [N, HW, 3].
    let pixels =
        |f: &dyn Fn(u64) -> u64| (0..width * height).map(|i| f(i) as f32 + 0.5).collect::<Vec<f32>>();
    g.floats("u", &[1, height, width], &pixels(&|i| i % width));
    g.floats("v", &[1, height, width], &pixels(&|i| i / width));
    g.integers("axes12", &[1, 2]);
    for (name, row, column) in [("fx", 0, 0), ("fy", 1, 1), ("cx", 0, 2), ("cy", 1, 2)] {
        let (from, to) = (format!("{name}_from"), format!("{name}_to"));
        g.integers(&from, &[row, column]).integers(&to, &[row + 1, column + 1]);
        g.node("Slice", &["intrinsics", &from, &to, "axes12"], name, &[]);
    }
    g.floats("zero", &[1], &[0.0]).floats("one", &[1], &[1.0]);
    g.node("Sub", &["u", "cx"], "uc", &[]).node("Div", &["uc", "fx"], "x", &[]);
    g.node("Sub", &["v", "cy"], "vc", &[]).node("Div", &["vc", "fy"], "y", &[]);
    g.node("Mul", &["x", "zero"], "x0", &[]).node("Add", &["x0", "one"], "z1", &[]);
    g.integers("last", &[-1]);
    for name in ["x", "y", "z1"] {
        g.node("Unsqueeze", &[name, "last"], &format!("{name}_"), &[]);
    }
    g.node("Concat", &["x_", "y_", "z1_"], "ray4", &[Attribute::Int("axis", -1)]);
    g.integers("flat", &[0, -1, 3]).node("Reshape", &["ray4", "flat"], "ray", &[]);

    // Directions and centres in the space where the ellipsoid is the unit ball: rows times matrices.
    let ball = DMat3::from_diagonal(HALF.recip()) * first.vehicle_from_camera.rotation;
    let transposed: Vec<f32> = ball.to_cols_array().map(|x| x as f32).to_vec();
    let centre = (first.vehicle_from_camera.translation / HALF).to_array().map(|x| x as f32);
    g.floats("ball", &[3, 3], &transposed).floats("centre", &[1, 1, 3], &centre);
    g.integers("r_from", &[0, 0]).integers("r_to", &[3, 3]);
    g.integers("t_from", &[0, 3]).integers("t_to", &[3, 4]);
    g.node("Slice", &["cam_to_ref", "r_from", "r_to", "axes12"], "R", &[]);
    g.node("Slice", &["cam_to_ref", "t_from", "t_to", "axes12"], "t", &[]);
    for (from, to) in [("R", "Rt"), ("t", "tt")] {
        g.node("Transpose", &[from], to, &[Attribute::Ints("perm", &[0, 2, 1])]);
    }
    g.node("MatMul", &["Rt", "ball"], "Rball", &[]).node("MatMul", &["ray", "Rball"], "e", &[]);
    g.node("MatMul", &["tt", "ball"], "o0", &[]).node("Add", &["o0", "centre"], "o", &[]);

    // |o + z e| = 1.
    for (a, b, product) in [("e", "e", "ee"), ("o", "e", "oe"), ("o", "o", "oo")] {
        g.node("Mul", &[a, b], &format!("{product}_"), &[]);
        g.node("ReduceSum", &[&format!("{product}_"), "last"], product, &[]);
    }
    g.node("Sub", &["oo", "one"], "c", &[]).node("Mul", &["ee", "c"], "ac", &[]);
    g.node("Mul", &["oe", "oe"], "bb", &[]).node("Sub", &["bb", "ac"], "disc", &[]);
    g.node("Relu", &["disc"], "disc0", &[]).node("Sqrt", &["disc0"], "root", &[]);
    g.node("Neg", &["oe"], "minus", &[]).node("Sub", &["minus", "root"], "top", &[]);
    g.node("Div", &["top", "ee"], "z", &[]);
    g.node("Mul", &["ray", "ray"], "rr_", &[]).node("ReduceSum", &["rr_", "last"], "rr", &[]);
    g.node("Sqrt", &["rr"], "length", &[]);
    match manner.along_ray {
        true => g.node("Mul", &["z", "length"], "d", &[]),
        false => g.node("Identity", &["z"], "d", &[]),
    };
    g.floats("unit", &[1], &[manner.unit]).node("Div", &["d", "unit"], "d_unit", &[]);
    g.integers("map", &[-1, height as i64, width as i64]);
    g.integers("map3", &[-1, height as i64, width as i64, 3]);
    g.node("Reshape", &["d_unit", "map"], "depth", &[]);
    g.node("Div", &["ray", "length"], "unit_ray", &[]).node("Reshape", &["unit_ray", "map3"], "rays", &[]);
    g.node("Greater", &["disc", "zero"], "hit", &[]);
    g.node("Cast", &["hit"], "hit_", &[Attribute::Int("to", 1)]).node(
        "Reshape",
        &["hit_", "map"],
        "mask",
        &[],
    );
    g.node("Add", &["mask", "one"], "confidence", &[]);
    g.floats("declared_unit", &[1], &[if manner.is_metric { manner.unit } else { 1.0 }]).node(
        "Identity",
        &["declared_unit"],
        "scale",
        &[],
    );

    // Translations in the network's unit.
    let mut shrink = [1.0f32; 16];
    [3, 7, 11].iter().for_each(|k: &usize| shrink[*k] = 1.0 / manner.unit);
    g.floats("shrink", &[1, 4, 4], &shrink).node("Mul", &["cam_to_ref", "shrink"], "cam_to_ref_pred", &[]);
    g
}

/// Replaces `output` of the graph by a constant `value` in all of its elements.
pub fn set_output(graph: &mut Graph, output: &str, value: f32) {
    graph.rename_output_of(output, "before");
    graph.floats("broken", &[1], &[value]).floats("nothing", &[1], &[0.0]);
    graph.node("Mul", &["before", "nothing"], "none", &[]);
    graph.node("Add", &["none", "broken"], output, &[]);
}
