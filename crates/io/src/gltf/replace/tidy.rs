//! Removal of empty attributes, primitives and meshes, and of references to them.

use std::collections::{BTreeSet, HashSet};

use serde_json::Value;

use super::super::container::{list, list_mut, number};
use super::super::lists::{drop_nulls, take_extension};
use super::super::references::{OF_INSTANCES, ReferenceKind};
use super::edit::Edit;
use crate::error::Warning;

/// Joins the first names, and counts the others.
fn first_few(names: &[String]) -> String {
    // Guessed: enough to know which part of a scene it is.
    const MAX_NAMES: usize = 3;
    let shown = names[..names.len().min(MAX_NAMES)].join(", ");
    match names.len().saturating_sub(MAX_NAMES) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}

impl Edit<'_> {
    /// Removes empty attributes, primitives and meshes.
    pub(super) fn tidy(&mut self) {
        match self.emptied.as_slice() {
            [] => {}
            [name] => {
                let text = format!("{name} has no faces left: removed, with its material");
                self.warnings.push(Warning::lost(text));
            }
            names => self.warnings.push(Warning::lost(format!(
                "{} primitives have no faces left: removed, with their materials: {}",
                names.len(),
                first_few(names)
            ))),
        }
        let mut emptied = BTreeSet::new();
        for (m, mesh) in list_mut(&mut self.json, "meshes").iter_mut().enumerate() {
            let Some(primitives) = mesh.get_mut("primitives").and_then(Value::as_array_mut) else { continue };
            let before = primitives.len();
            if let Some(first) = primitives.iter().position(Value::is_null) {
                self.changes.change(first..before);
            }
            primitives.retain(|p| !p.is_null());
            if primitives.is_empty() && before > 0 {
                emptied.insert(m);
            }
            for primitive in primitives.iter_mut().filter_map(Value::as_object_mut) {
                if let Some(attributes) = primitive.get_mut("attributes").and_then(Value::as_object_mut) {
                    drop_nulls(attributes);
                }
                let targets = primitive.get_mut("targets").and_then(Value::as_array_mut);
                targets.into_iter().flatten().filter_map(Value::as_object_mut).for_each(drop_nulls);
                if primitive.get("indices").is_some_and(Value::is_null) {
                    primitive.shift_remove("indices");
                }
            }
        }
        self.remove_skins();
        if !emptied.is_empty() {
            self.remove_meshes(&emptied);
        }
    }

    /// Removes the skin of nodes whose mesh has lost its joints.
    fn remove_skins(&mut self) {
        let has_joints =
            |mesh: &Value| list(mesh, "primitives").iter().any(|p| !p["attributes"]["JOINTS_0"].is_null());
        let meshes = list(self.source, "meshes").iter().zip(list(&self.json, "meshes"));
        let lost_joints: Vec<bool> =
            meshes.map(|(before, now)| has_joints(before) && !has_joints(now)).collect();
        for (n, node) in list_mut(&mut self.json, "nodes").iter_mut().enumerate() {
            let Some(node) = node.as_object_mut() else { continue };
            let mesh = node.get("mesh").and_then(number);
            if mesh.is_some_and(|m| lost_joints.get(m) == Some(&true)) {
                self.changes.change([n]);
                node.shift_remove("skin");
            }
        }
    }

    /// Removes meshes without primitives, and all references of nodes and animations to them.
    fn remove_meshes(&mut self, emptied: &BTreeSet<usize>) {
        let names: Vec<String> = emptied.iter().map(|m| format!("meshes[{m}]")).collect();
        self.warnings.push(Warning::lost(match names.as_slice() {
            [name] => format!("{name} has no faces left: removed, its nodes are empty"),
            _ => format!(
                "{} meshes have no faces left: removed, their nodes are empty: {}",
                names.len(),
                first_few(&names)
            ),
        }));
        let mut bare = HashSet::new();
        for (n, node) in list_mut(&mut self.json, "nodes").iter_mut().enumerate() {
            if !node.get("mesh").and_then(number).is_some_and(|mesh| emptied.contains(&mesh)) {
                continue;
            }
            bare.insert(n);
            self.changes.move_mesh(n, None);
            for name in OF_INSTANCES {
                take_extension(node, name);
            }
            if let Some(node) = node.as_object_mut() {
                ["mesh", "skin", "weights"].iter().for_each(|key| drop(node.shift_remove(*key)));
            }
        }
        // Such a channel no longer has a mesh to morph.
        self.changes.drop_channels(&mut self.json, &|channel| {
            let target = &channel["target"];
            target["path"] == "weights" && number(&target["node"]).is_some_and(|n| bare.contains(&n))
        });
        self.changes.remove(&self.json, ReferenceKind::Mesh, &|m, _| emptied.contains(&m));
    }
}
