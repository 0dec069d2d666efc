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
    let forward = compare(&a.surface(), &b.surface(), &options);
    let backward = compare(&b.surface(), &a.surface(), &options);
    let (Ok(forward), Ok(backward)) = (&forward, &backward) else {
        assert!(forward.is_err() && backward.is_err(), "only one direction is refused");
        return;
    };
    for (figure, other) in [(forward.hausdorff, backward.hausdorff), (forward.mean, backward.mean), (forward.rms, backward.rms)]
    {
        for x in [figure.forward, figure.backward, figure.symmetric] {
            assert!(x >= 0.0, "a distance of {x}");
        }
        assert_eq!((figure.forward, figure.backward), (other.backward, other.forward));
    }
    assert!(forward.mean.forward <= forward.hausdorff.forward * (1.0 + 1e-9), "the mean is larger than the maximum");
    let itself = compare(&a.surface(), &a.surface(), &options).expect("the comparison succeeded before");
    if forward.diagonal.is_finite() {
        assert!(
            itself.hausdorff.symmetric <= 1e-6 * itself.diagonal,
            "distance to itself: {}",
            itself.hausdorff.symmetric
        );
    }
});
