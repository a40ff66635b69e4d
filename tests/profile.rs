//! The profiler: what the device counts, what it measures, and how the figures hang together. Times decide nothing
//! here; what must hold on any machine are orders, sums and names.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use common::Device;

#[test]
fn counters_are_believed_only_where_they_are_exact() {
    let Some(device) = Device::open() else { return };
    let report = surfel::gpu::profile::counter_test(device.gpu()).unwrap();
    println!("{report:#?}");
    let info = device.gpu().info();
    let names: Vec<&str> = report.rows.iter().map(|r| r.name).collect();
    assert_eq!(
        names,
        [
            "samples",
            "input_vertices",
            "input_primitives",
            "vertex_invocations",
            "clipping_invocations",
            "clipping_primitives",
            "fragment_invocations"
        ]
    );
    for row in &report.rows {
        let has = if row.name == "samples" {
            info.has_sample_counts
        } else {
            info.has_pipeline_statistics
        };
        assert_eq!(row.counted.is_some(), has, "{}", row.name);
        assert_eq!(report.is_exact(row.name), row.counted == Some(row.expected));
    }
    // A precise count of samples has no room for error: 64 x 64 pixels, then 256 x 256, then nothing.
    if info.has_sample_counts {
        assert_eq!(report.rows[0].counted, Some([4096, 65536, 0]));
    }
    assert!(!report.is_exact("no such counter"));
}
