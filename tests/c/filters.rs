//! Files of filters with weights of 0.

use std::ffi::CString;
use std::path::Path;
use svl_core::filter::{Features, FilterKind, FilterModel, ModelFacts, Network, Scaling};

/// The files of a filter that says floor everywhere, and of one that says too close.
pub fn files(folder: &Path) -> [(FilterModel, CString); 2] {
    [
        (FilterKind::Floor, None),
        (FilterKind::TooClose, Some(64.0)),
    ]
    .map(|(kind, range_px)| {
        let features = Features {
            window: 64,
            scaling: Scaling::Log,
        };
        let weights = vec![0.0; 7 * features.count()];
        let network = Network::new(features.count(), &weights, vec![0.0; 7], vec![0.0; 7], 1.0);
        let model = FilterModel {
            kind,
            features,
            network: network.unwrap(),
            range_px,
            facts: ModelFacts::new(),
        };
        let path = folder.join(format!("{}.safetensors", kind.name()));
        std::fs::write(&path, model.to_bytes()).unwrap();
        (model, CString::new(path.to_str().unwrap()).unwrap())
    })
}
