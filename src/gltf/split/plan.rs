//! What the accessors will hold: of meshes that are taken apart, what is left; of parts, their own. Changes nothing.

use super::domains::{Domain, Domains};
use super::{Part, Repeated};
use crate::gltf::accessor::Accessor;
use crate::gltf::buffers::Buffers;
use crate::gltf::document::Document;
use crate::gltf::error::DocumentError;
use crate::gltf::share::{index, names};
use crate::gltf::triangles::is_whole;
use crate::gltf::views::Views;
use crate::mesh::ComponentType;
use serde_json::Value;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

/// Elements of one accessor, ready to be written.
#[derive(Debug)]
pub(super) struct Column {
    pub(super) count: usize,
    /// Elements at multiples of four, if they are vertices.
    pub(super) bytes: Vec<u8>,
    /// Bytes from one element to the next.
    pub(super) stride: usize,
    /// Bytes of an element.
    pub(super) size: usize,
    pub(super) component: ComponentType,
    /// Least and greatest of each component, as stored; empty for indices.
    pub(super) bounds: [Vec<f64>; 2],
}

/// One primitive of a part.
#[derive(Debug)]
pub(super) struct PartPrimitive {
    /// Where it came from.
    pub(super) source: (usize, usize),
    /// By name: the accessor it came from, and its own elements.
    pub(super) attributes: Vec<(String, usize, Column)>,
    pub(super) indices: Column,
}

/// All that is to be written.
#[derive(Debug, Default)]
pub(super) struct Plan {
    /// What is left of an accessor.
    pub(super) vertices: BTreeMap<usize, Column>,
    /// Indices of primitives over fewer vertices, by mesh and primitive.
    pub(super) indices: BTreeMap<(usize, usize), Column>,
    /// For each group the primitives of its new mesh, if it gets one.
    pub(super) parts: Vec<Option<Vec<PartPrimitive>>>,
}

impl Plan {
    pub(super) fn new(document: &Document, buffers: &Buffers, groups: &[Repeated]) -> Result<Self, DocumentError> {
        let views = Views::new(document, buffers)?;
        let mut source = Source { document, views: &views, lists: BTreeMap::new(), packed: BTreeMap::new() };
        let mut going: BTreeMap<(usize, usize), BTreeSet<u32>> = BTreeMap::new();
        for (part, _) in groups.iter().flat_map(|group| &group.occurrences) {
            for (primitive, triangles) in &part.triangles {
                going.entry((part.mesh, *primitive)).or_default().extend(triangles);
            }
        }
        let mut plan = Self::default();
        // A part that stays where it is may still be the one that the others show.
        let firsts = groups
            .iter()
            .filter(|group| group.mesh.is_none())
            .flat_map(|group| group.of.triangles.iter().map(move |(primitive, _)| (group.of.mesh, *primitive)));
        let shown: BTreeSet<(usize, usize)> = firsts.collect();
        for domain in Domains::new(document)?.all() {
            let is_left = domain.users.iter().any(|user| going.contains_key(user));
            if is_left || domain.users.iter().any(|user| shown.contains(user)) {
                source.read(domain)?;
            }
            if is_left {
                source.rest(domain, &going, &mut plan)?;
            }
        }
        for group in groups {
            let own = group.mesh.is_none().then(|| source.part(&group.of));
            plan.parts.push(own.transpose()?);
        }
        Ok(plan)
    }
}

/// The source's numbers, each read once.
struct Source<'d> {
    document: &'d Document,
    views: &'d Views<'d>,
    /// Triangles of primitives, and the size of their indices.
    lists: BTreeMap<(usize, usize), (List, Option<ComponentType>)>,
    /// Elements of accessors without gaps.
    packed: BTreeMap<usize, Cow<'d, [u8]>>,
}

/// Indices as they stand. Triangles have the numbers of the list that was read, which has none that uses an index twice.
struct List {
    indices: Vec<u32>,
    /// For each triangle which three of the indices it is.
    triangles: Vec<u32>,
}

impl List {
    fn new(indices: Vec<u32>) -> Self {
        let threes = (0..).zip(indices.as_chunks::<3>().0);
        let triangles = threes.filter(|(_, t)| is_whole(t)).map(|(three, _)| three).collect();
        Self { indices, triangles }
    }

    fn corners(&self, triangle: u32) -> &[u32] {
        let three = self.triangles.get(triangle as usize).map_or(0, |&three| three as usize);
        &self.indices[three * 3..][..3]
    }

    /// Threes of indices, what is left at the end among them, with whether they are triangles of `chosen`.
    fn threes(&self, chosen: Option<&BTreeSet<u32>>) -> impl Iterator<Item = (&[u32], bool)> {
        let mut is_chosen = vec![false; self.indices.len().div_ceil(3)];
        let chosen = chosen.into_iter().flatten().filter_map(|&triangle| self.triangles.get(triangle as usize));
        chosen.for_each(|&three| is_chosen[three as usize] = true);
        self.indices.chunks(3).zip(is_chosen)
    }
}

impl<'d> Source<'d> {
    fn primitive(&self, (mesh, primitive): (usize, usize)) -> Result<&'d Value, DocumentError> {
        Ok(&self.document.array("meshes")?[mesh]["primitives"][primitive])
    }

    fn accessor(&self, accessor: usize) -> Result<Accessor<'d>, DocumentError> {
        Accessor::parse(self.document, accessor, "accessors")
    }

    /// Indices as they stand, and the size of their numbers.
    fn indices(&self, user: (usize, usize)) -> Result<(Vec<u32>, Option<ComponentType>), DocumentError> {
        let primitive = self.primitive(user)?;
        if let Some(indices) = index(primitive, "indices") {
            let accessor = self.accessor(indices)?;
            return Ok((accessor.indices(self.views)?, Some(accessor.layout.component)));
        }
        let count = index(&primitive["attributes"], "POSITION").map(|position| self.accessor(position)).transpose()?;
        Ok(((0..count.map_or(0, |accessor| accessor.count as u32)).collect(), None))
    }

    /// Reads what a domain has.
    fn read(&mut self, domain: &Domain) -> Result<(), DocumentError> {
        for &user in &domain.users {
            let (indices, component) = self.indices(user)?;
            self.lists.insert(user, (List::new(indices), component));
        }
        for &accessor in &domain.accessors {
            self.packed.insert(accessor, self.accessor(accessor)?.packed(self.views)?);
        }
        Ok(())
    }

    /// What is left of a domain: vertices that only triangles used which go, go.
    fn rest(
        &self,
        domain: &Domain,
        going: &BTreeMap<(usize, usize), BTreeSet<u32>>,
        plan: &mut Plan,
    ) -> Result<(), DocumentError> {
        let Some(&one) = domain.accessors.first() else { return Ok(()) };
        let count = self.accessor(one)?.count as usize;
        let (mut stays, mut goes) = (vec![false; count], vec![false; count]);
        let mut rests = Vec::new();
        for &user in &domain.users {
            let Some((list, component)) = self.lists.get(&user) else { continue };
            let mut rest = Vec::with_capacity(list.indices.len());
            for (three, is_going) in list.threes(going.get(&user)) {
                let used = if is_going { &mut goes } else { &mut stays };
                for &v in three {
                    used[v as usize] = true;
                }
                if !is_going {
                    rest.extend_from_slice(three);
                }
            }
            rests.push((user, rest, *component));
        }
        let kept: Vec<u32> = (0..count as u32).filter(|&v| stays[v as usize] || !goes[v as usize]).collect();
        let mut place = vec![0u32; count];
        (0..).zip(&kept).for_each(|(new, &old)| place[old as usize] = new);
        for &accessor in &domain.accessors {
            plan.vertices.insert(accessor, self.rows(accessor, &kept)?);
        }
        for (user, mut rest, component) in rests {
            for v in &mut rest {
                *v = place[*v as usize];
            }
            plan.indices.insert(user, Column::of_indices(&rest, kept.len(), component));
        }
        Ok(())
    }

    fn part(&self, part: &Part) -> Result<Vec<PartPrimitive>, DocumentError> {
        let primitive = |(primitive, triangles): &(usize, Vec<u32>)| {
            let source = (part.mesh, *primitive);
            let list = self.lists.get(&source).map(|(list, _)| list);
            let mut corners: Vec<u32> =
                triangles.iter().flat_map(|&t| list.map_or(&[][..], |list| list.corners(t))).copied().collect();
            let mut used = corners.clone();
            used.sort_unstable();
            used.dedup();
            for v in &mut corners {
                *v = used.partition_point(|u| u < v) as u32;
            }
            let members = &self.primitive(source)?["attributes"];
            let attributes = names(Some(members))
                .filter_map(|name| Some((name.to_owned(), index(members, name)?)))
                .map(|(name, accessor)| Ok((name, accessor, self.rows(accessor, &used)?)));
            Ok(PartPrimitive {
                source,
                attributes: attributes.collect::<Result<_, DocumentError>>()?,
                indices: Column::of_indices(&corners, used.len(), None),
            })
        };
        part.triangles.iter().map(primitive).collect()
    }

    /// Some elements of an accessor, bit for bit.
    fn rows(&self, accessor: usize, rows: &[u32]) -> Result<Column, DocumentError> {
        let packed = self.packed.get(&accessor).map_or(&[][..], |packed| packed);
        let accessor = self.accessor(accessor)?;
        let (size, component) = (accessor.layout.size(), accessor.layout.component);
        let stride = size.next_multiple_of(4);
        let mut bytes = Vec::with_capacity(rows.len() * stride);
        let components = accessor.layout.components();
        let mut bounds = [vec![f64::INFINITY; components], vec![f64::NEG_INFINITY; components]];
        for &row in rows {
            let start = bytes.len();
            let element = &packed[row as usize * size..][..size];
            bytes.extend_from_slice(element);
            bytes.resize(start + stride, 0);
            for (i, number) in element.chunks_exact(component.size()).enumerate() {
                let value = number_of(number, component);
                bounds[0][i] = bounds[0][i].min(value);
                bounds[1][i] = bounds[1][i].max(value);
            }
        }
        Ok(Column { count: rows.len(), bytes, stride, size, component, bounds })
    }
}

impl Column {
    /// As small as the number of vertices allows, but for bytes where there were none before.
    fn of_indices(indices: &[u32], vertices: usize, before: Option<ComponentType>) -> Self {
        let component = match before {
            Some(ComponentType::U8) => ComponentType::U8,
            // The largest number would start the primitive again.
            _ if u16::try_from(vertices).is_ok() => ComponentType::U16,
            _ => ComponentType::U32,
        };
        let bytes = match component {
            ComponentType::U8 => indices.iter().map(|&i| i as u8).collect(),
            ComponentType::U16 => indices.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect(),
            _ => indices.iter().flat_map(|&i| i.to_le_bytes()).collect(),
        };
        let size = component.size();
        Self { count: indices.len(), bytes, stride: size, size, component, bounds: [Vec::new(), Vec::new()] }
    }
}

fn number_of(bytes: &[u8], component: ComponentType) -> f64 {
    match (component, bytes) {
        (ComponentType::I8, &[a]) => f64::from(a as i8),
        (ComponentType::U8, &[a]) => f64::from(a),
        (ComponentType::I16, &[a, b]) => f64::from(i16::from_le_bytes([a, b])),
        (ComponentType::U16, &[a, b]) => f64::from(u16::from_le_bytes([a, b])),
        (ComponentType::U32, &[a, b, c, d]) => f64::from(u32::from_le_bytes([a, b, c, d])),
        (_, &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
        _ => f64::NAN,
    }
}
