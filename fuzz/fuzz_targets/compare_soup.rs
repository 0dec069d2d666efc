//! Compares two small random triangle soups: distances are not negative, and swapping the meshes swaps the
//! directions.
#![no_main]

use lodsmith_core::measure::{CompareOptions, compare};
use lodsmith_fuzz::soup::{self, Bytes};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut bytes = Bytes(bytes);
    let mut options = CompareOptions::default();
    options.samples = usize::from(bytes.next()) * 4;
    let [a, b] = [soup::mesh(&mut bytes), soup::mesh(&mut bytes)];
    let there = compare(&a.surface(), &b.surface(), &options);
    let back = compare(&b.surface(), &a.surface(), &options);
    let (Ok(there), Ok(back)) = (&there, &back) else {
        assert!(there.is_err() && back.is_err(), "only one way is refused");
        return;
    };
    for (figure, other) in [(there.hausdorff, back.hausdorff), (there.mean, back.mean), (there.rms, back.rms)]
    {
        for x in [figure.forward, figure.backward, figure.symmetric] {
            assert!(x >= 0.0, "a distance of {x}");
        }
        assert_eq!((figure.forward, figure.backward), (other.backward, other.forward));
    }
    assert!(there.mean.forward <= there.hausdorff.forward * (1.0 + 1e-9), "a mean above the largest");
    let itself = compare(&a.surface(), &a.surface(), &options).expect("it was compared before");
    if there.diagonal.is_finite() {
        assert!(
            itself.hausdorff.symmetric <= 1e-6 * itself.diagonal,
            "off itself by {}",
            itself.hausdorff.symmetric
        );
    }
});
