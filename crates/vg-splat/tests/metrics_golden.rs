//! PSNR and SSIM compared with scikit-image's results for the same pictures.

use serde::Deserialize;

#[derive(Deserialize)]
struct Golden {
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    name: String,
    width: u32,
    height: u32,
    a: Vec<u8>,
    b: Vec<u8>,
    ssim: f64,
    /// `None` if the pictures are equal.
    psnr: Option<f64>,
}

/// Pictures are f32 in [0, 1] here and f64 there, so that values differ by 3e-8 relatively. Measured: 3e-8 and
/// 5e-7 dB at most, both for two flat pictures.
const SSIM_TOLERANCE: f64 = 1e-7;
const PSNR_TOLERANCE_DB: f64 = 1e-6;

#[test]
fn psnr_and_ssim_equal_those_of_scikit_image() {
    let path = vg_testing::root().join("tests/golden/ssim_skimage.json");
    let golden: Golden = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    assert!(golden.cases.len() >= 5);
    for case in &golden.cases {
        let picture = |bytes: &[u8]| -> Vec<[f32; 3]> {
            bytes.as_chunks::<3>().0.iter().map(|p| p.map(|c| f32::from(c) / 255.0)).collect()
        };
        let (a, b) = (picture(&case.a), picture(&case.b));
        let name = &case.name;
        let ssim = vg_splat::quality::ssim(&a, &b, case.width, case.height).unwrap();
        println!("{name}: SSIM off by {:.1e}", (ssim - case.ssim).abs());
        assert!((ssim - case.ssim).abs() <= SSIM_TOLERANCE, "{name}: {ssim} and {}", case.ssim);
        let psnr = vg_splat::quality::psnr(&a, &b);
        match case.psnr {
            None => assert_eq!(psnr, f64::INFINITY, "{name}"),
            Some(expected) => {
                println!("{name}: PSNR off by {:.1e} dB", (psnr - expected).abs());
                assert!((psnr - expected).abs() <= PSNR_TOLERANCE_DB, "{name}: {psnr} and {expected}");
            }
        }
    }
}

#[test]
fn a_picture_smaller_than_the_window_has_no_ssim() {
    let gray = vec![[0.5; 3]; 10 * 30];
    assert_eq!(vg_splat::quality::ssim(&gray, &gray, 10, 30), None);
}
