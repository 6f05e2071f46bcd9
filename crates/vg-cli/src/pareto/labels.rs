//! Places the names of points so that they do not overlap.

/// Mean width of a letter at a font size of 13 pixels, and height of a line.
const LETTER: f64 = 6.9;
const LINE: f64 = 14.0;

/// Distances that are tried between a point and its name.
const GAPS: [f64; 3] = [7.0, 16.0, 28.0];

/// Samples along each piece of the front.
const SAMPLES: usize = 40;

/// A rectangle: left, top, right, bottom.
type Rectangle = [f64; 4];

/// The left end of the baseline of each point's name.
pub(super) fn places(points: &[([f64; 2], &str)], front: &[[f64; 2]], picture: Rectangle) -> Vec<[f64; 2]> {
    let line: Vec<[f64; 2]> = front
        .windows(2)
        .flat_map(|ends| {
            let at = |i: usize, k: usize| ends[0][k] + (ends[1][k] - ends[0][k]) * i as f64 / SAMPLES as f64;
            (0..SAMPLES).map(move |i| [at(i, 0), at(i, 1)])
        })
        .collect();
    let mut taken: Vec<Rectangle> = Vec::new();
    let mut placed = Vec::new();
    for (at, name) in points {
        let width = LETTER * name.chars().count() as f64;
        let cost = |label: &Rectangle| {
            let dots = points.iter().filter(|(p, _)| holds(label, *p, 4.0)).count();
            let outside = usize::from(both(label, &picture) < (label[2] - label[0]) * LINE - 1e-6);
            let crossed = line.iter().filter(|p| holds(label, **p, 1.0)).count();
            let covered: f64 = taken.iter().map(|other| both(label, other)).sum();
            1000.0 * outside as f64 + 100.0 * dots as f64 + 20.0 * crossed as f64 + covered
        };
        let around = GAPS.into_iter().flat_map(|gap| around(*at, width, gap));
        let found = around.min_by(|a, b| cost(a).total_cmp(&cost(b)));
        let label = found.unwrap_or([at[0], at[1], at[0], at[1]]);
        taken.push(label);
        // Descenders hang below the baseline.
        placed.push([label[0], label[3] - 0.25 * LINE]);
    }
    placed
}

/// Eight places around a point, the usual ones first.
fn around([x, y]: [f64; 2], width: f64, gap: f64) -> [Rectangle; 8] {
    let (right, left, middle) = (x + gap, x - gap - width, x - 0.5 * width);
    let (below, above, level) = (y + 0.7 * gap, y - 0.7 * gap - LINE, y - 0.5 * LINE);
    let at = |left: f64, top: f64| [left, top, left + width, top + LINE];
    [
        at(right, below),
        at(right, level),
        at(right, above),
        at(left, above),
        at(left, level),
        at(left, below),
        at(middle, y + gap),
        at(middle, y - gap - LINE),
    ]
}

fn holds(label: &Rectangle, [x, y]: [f64; 2], margin: f64) -> bool {
    (label[0] - margin..=label[2] + margin).contains(&x)
        && (label[1] - margin..=label[3] + margin).contains(&y)
}

/// Area of the intersection of two rectangles.
fn both(a: &Rectangle, b: &Rectangle) -> f64 {
    let side = |k: usize| (a[k + 2].min(b[k + 2]) - a[k].max(b[k])).max(0.0);
    side(0) * side(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_near_points_lie_apart_and_inside() {
        let names = ["half resolution", "no photographs", "SH 0", "default", "quarter"];
        let spots = [[790.0, 100.0], [785.0, 104.0], [780.0, 96.0], [775.0, 101.0], [70.0, 460.0]];
        let points: Vec<([f64; 2], &str)> = spots.into_iter().zip(names).collect();
        let picture = [64.0, 48.0, 836.0, 464.0];
        let placed = places(&points, &[], picture);
        let boxes: Vec<Rectangle> = placed
            .iter()
            .zip(names)
            .map(|(p, name)| {
                let bottom = p[1] + 0.25 * LINE;
                [p[0], bottom - LINE, p[0] + LETTER * name.len() as f64, bottom]
            })
            .collect();
        for (i, a) in boxes.iter().enumerate() {
            assert!(a[0] >= 64.0 && a[2] <= 836.0 && a[1] >= 48.0 && a[3] <= 464.0, "{}: {a:?}", names[i]);
            for (b, name) in boxes[..i].iter().zip(names) {
                assert!(both(a, b) < 1e-6, "{} on {name}", names[i]);
            }
            assert!(spots.iter().all(|p| !holds(a, *p, 0.0)), "{} on a point", names[i]);
        }
    }
}
