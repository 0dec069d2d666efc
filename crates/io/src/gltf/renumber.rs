//! Changes of the numbers of elements, and what follows from them everywhere in the file.
//!
//! ```text
//! references of the core and of known extensions get the new numbers; entries that name what is gone go
//! entries of the lists that are gone are removed
//! channels of animations without a target go, then their samplers, then animations without channels
//! an opaque extension goes if it may contain a number that has another meaning now
//! ```

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use super::container::{list, list_mut, number};
use super::extension_losses::{ExtensionLosses, LossReason};
use super::lists::{drop_unused_extensions, retain};
use super::references::{
    POINTERS, ReferenceKind, VRM_0, each_core_reference, each_extension, known, may_name, pointed_element,
};
use super::vrm;

/// New numbers of the elements of a file, and changes of their meaning, which an edit collects.
#[derive(Clone, Debug, Default)]
pub(super) struct Renumbering {
    /// By kind the new number of each element; `None` for those that are gone.
    moved: BTreeMap<ReferenceKind, Vec<Option<usize>>>,
    /// By node, the node that has its mesh now; `None` if its mesh is gone.
    meshes_of_nodes: BTreeMap<usize, Option<usize>>,
    /// Numbers whose meaning changes, of elements of any kind.
    changed: BTreeSet<usize>,
}

impl Renumbering {
    /// Takes elements out of their list; the others move up.
    pub(super) fn remove(
        &mut self,
        json: &Value,
        kind: ReferenceKind,
        is_gone: &dyn Fn(usize, &Value) -> bool,
    ) {
        let mut next = 0;
        let elements = kind.list().map_or(&[][..], |name| list(json, name)).iter().enumerate();
        let ranks: Vec<Option<usize>> = elements
            .map(|(i, element)| {
                let is_kept = !is_gone(i, element);
                next += usize::from(is_kept);
                is_kept.then(|| next - 1)
            })
            .collect();
        let moves = ranks.iter().enumerate().filter(|(i, rank)| **rank != Some(*i));
        self.changed.extend(moves.map(|(i, _)| i));
        if next < ranks.len() {
            self.moved.insert(kind, ranks);
        }
    }

    /// Takes accessors and views that are null out of their lists.
    pub(super) fn remove_nulls(&mut self, json: &Value) {
        for kind in [ReferenceKind::Accessor, ReferenceKind::View] {
            self.remove(json, kind, &|_, element| element.is_null());
        }
    }

    /// Records that the meaning of elements changes, while their numbers stay.
    pub(super) fn change(&mut self, numbers: impl IntoIterator<Item = usize>) {
        self.changed.extend(numbers);
    }

    /// Records that the mesh of a node is at another node now, or gone.
    pub(super) fn move_mesh(&mut self, node: usize, to: Option<usize>) {
        self.changed.insert(node);
        self.meshes_of_nodes.insert(node, to);
    }

    /// Changes all references in the file, and removes the elements that are gone from their lists. `losses` are those of
    /// the edit so far.
    pub(super) fn apply(mut self, json: &mut Value, losses: &mut ExtensionLosses) {
        if !self.changed.is_empty() {
            self.change_references(json, losses);
            self.drop_extensions(json, losses);
        }
        let names = losses.names();
        if !names.is_empty() {
            drop_unused_extensions(json, &names.iter().map(String::as_str).collect::<Vec<_>>());
        }
    }

    fn change_references(&mut self, json: &mut Value, losses: &mut ExtensionLosses) {
        if let Some(materials) = self.moved.get(&ReferenceKind::Material) {
            losses.add(LossReason::Entries, VRM_0, vrm::remove_materials(json, materials));
        }
        let mut dead_pointers = false;
        each_extension(json, &mut |host, name, content| {
            let Some(known) = known(name) else { return true };
            let mut removed = 0;
            let update = &mut |kind, value: &mut Value| self.update(kind, value);
            let is_kept = known.visit(host, content, &mut removed, update);
            losses.add(LossReason::Entries, name, removed);
            if !is_kept && name == POINTERS {
                dead_pointers = true;
            } else if !is_kept {
                losses.add(LossReason::Gone, name, 1);
            }
            is_kept
        });
        each_core_reference(json, &mut |kind, value| {
            self.update(kind, value);
        });
        for (kind, ranks) in &self.moved {
            if let Some(name) = kind.list() {
                retain(json, name, &|i, _| ranks.get(i).is_some_and(Option::is_none));
            }
        }
        if dead_pointers {
            let is_dead = |channel: &Value| {
                let target = &channel["target"];
                target["path"] == "pointer" && target["extensions"][POINTERS].is_null()
            };
            losses.add(LossReason::Channels, POINTERS, self.drop_channels(json, &is_dead));
        }
    }

    /// Changes a reference; returns false if what it names is gone.
    fn update(&self, kind: ReferenceKind, value: &mut Value) -> bool {
        if kind == ReferenceKind::Pointer {
            let Some(new) = value.as_str().map(|pointer| self.pointer(pointer)) else { return true };
            return new.is_some_and(|new| {
                if value.as_str() != Some(&new) {
                    *value = new.into();
                }
                true
            });
        }
        let Some(old) = number(value) else { return true };
        match self.new_number(kind, old) {
            Some(new) if new == old => true,
            Some(new) => {
                *value = new.into();
                true
            }
            None => false,
        }
    }

    /// Returns the new number of an element; `None` if it is gone.
    fn new_number(&self, kind: ReferenceKind, old: usize) -> Option<usize> {
        use ReferenceKind::{Child, Mesh, MeshNode, Node, ShapeMesh, ShapeNode};
        let list = match kind {
            MeshNode | ShapeNode => match self.meshes_of_nodes.get(&old) {
                Some(new) => return *new,
                None => Node,
            },
            ShapeMesh => Mesh,
            Child => Node,
            other => other,
        };
        self.moved.get(&list).and_then(|ranks| ranks.get(old)).map_or(Some(old), |rank| *rank)
    }

    /// Returns a JSON pointer with the new number of its element; `None` if that is gone.
    fn pointer(&self, pointer: &str) -> Option<String> {
        let Some((kind, old, rest)) = pointed_element(pointer) else { return Some(pointer.to_owned()) };
        let new = self.new_number(kind, old)?;
        Some(format!("/{}/{new}{rest}", kind.list()?))
    }

    /// Removes channels for which `is_dead` holds, samplers that only they used, and animations that have no channel
    /// left. Returns the number of channels.
    pub(super) fn drop_channels(&mut self, json: &mut Value, is_dead: &dyn Fn(&Value) -> bool) -> usize {
        let mut dropped = 0;
        for animation in list_mut(json, "animations") {
            let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) else {
                continue;
            };
            let sampler = |channel: &Value| number(&channel["sampler"]);
            let mut loose: BTreeSet<usize> = BTreeSet::new();
            let before = channels.len();
            channels.retain(|channel| {
                let is_dead = is_dead(channel);
                loose.extend(sampler(channel).filter(|_| is_dead));
                !is_dead
            });
            dropped += before - channels.len();
            if channels.len() == before {
                continue;
            }
            if channels.is_empty() {
                *animation = Value::Null;
                continue;
            }
            channels.iter().filter_map(sampler).for_each(|used| {
                loose.remove(&used);
            });
            for channel in channels {
                if let Some(old) = sampler(channel) {
                    channel["sampler"] = (old - loose.range(..old).count()).into();
                }
            }
            retain(animation, "samplers", &|i, _| loose.contains(&i));
        }
        // No known extension refers to animations.
        if let Some(first) = list(json, "animations").iter().position(Value::is_null) {
            self.changed.extend(first..list(json, "animations").len());
            retain(json, "animations", &|_, animation| animation.is_null());
        }
        dropped
    }

    /// Removes opaque extensions that may contain a number that has changed, extensions that rely on others that are
    /// gone, and channels that move properties of extensions that are gone.
    fn drop_extensions(&mut self, json: &mut Value, losses: &mut ExtensionLosses) {
        loop {
            let before = losses.count();
            let support: Vec<&str> = losses
                .names()
                .iter()
                .filter_map(|name| known(name))
                .flat_map(|known| known.users)
                .copied()
                .collect();
            each_extension(json, &mut |_, name, content| {
                let (reason, is_lost) = match known(name) {
                    Some(_) => (LossReason::Gone, support.contains(&name)),
                    None => (LossReason::Opaque, may_name(content, &|n| self.changed.contains(&n))),
                };
                losses.add(reason, name, usize::from(is_lost));
                !is_lost
            });
            let dead = dead_pointers(json, &losses.names());
            if !dead.is_empty() {
                let is_dead = |channel: &Value| pointer_of(channel).is_some_and(|p| dead.contains(p));
                losses.add(LossReason::Channels, POINTERS, self.drop_channels(json, &is_dead));
            }
            if losses.count() == before {
                return;
            }
        }
    }
}

/// Returns the pointer of a channel of an animation, if it has one.
pub(super) fn pointer_of(channel: &Value) -> Option<&str> {
    channel["target"]["extensions"][POINTERS]["pointer"].as_str()
}

/// Sets the pointer of a channel that has one.
pub(super) fn set_pointer(channel: &mut Value, pointer: String) {
    channel["target"]["extensions"][POINTERS]["pointer"] = pointer.into();
}

/// Returns the pointers of animations into extensions of these names that are no longer there.
fn dead_pointers(json: &Value, names: &[String]) -> BTreeSet<String> {
    let channels = list(json, "animations").iter().flat_map(|a| list(a, "channels"));
    let is_dead = |pointer: &&str| {
        names.iter().any(|name| {
            let part = format!("/extensions/{name}");
            let ends = pointer.match_indices(&part).map(|(at, part)| at + part.len());
            ends.filter(|end| matches!(pointer.as_bytes().get(*end), None | Some(b'/')))
                .any(|end| json.pointer(&pointer[..end]).is_none())
        })
    };
    channels.filter_map(pointer_of).filter(is_dead).map(str::to_owned).collect()
}
