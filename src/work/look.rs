//! Judging the levels of one mesh by pictures: the mesh alone, in its own space, with the materials of its scene.
//!
//! Always on the CPU, whose pictures are the same bit for bit on every machine: what is seen here decides bytes and
//! recorded figures. Knows no scene and no cache.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::appearance::drawable::{Drawable, Part};
use crate::appearance::looks::Looks;
use crate::appearance::metric::{Comparison, Reference};
use crate::appearance::render::{Cpu, Shot};
use crate::appearance::soup::soup;
use crate::appearance::views::rhombicuboctahedron;
use crate::compare::{Corners, SurfaceDistance};
use crate::mesh::Level;
use crate::plan::{MeshLook, PartTask};

/// How a level differs from its source.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LevelLook {
    /// d_RMS: root mean square of luminance differences over 24 views, 0…255.
    pub d_rms: f64,
    /// The same of the view that differs most.
    pub worst_view: f64,
    /// Share of the pixels covered by either that only one covers, 0…1.
    pub silhouette: f64,
    /// Distances between the surfaces; `None` where nothing is left of one.
    pub surface: Option<SurfaceDistance>,
}

/// Points on each surface for [`LevelLook::surface`], for each triangle of the source, and the range that the number is kept
/// in. With the most, means and root mean squares are steady to a hundredth (median over 33 levels of `corpus/quality`; 4 in a
/// hundred at the 90th percentile); a bolt of 100 triangles does not need as many.
const SAMPLES_PER_TRIANGLE: usize = 4;
const SAMPLES: (usize, usize) = (1024, 8192);

/// The source of one mesh, drawn once.
pub(super) struct Judge<'a> {
    tasks: &'a [PartTask],
    size: u32,
    looks: Arc<Looks>,
    /// One list for each task, one part for each primitive.
    source: Vec<Vec<Arc<Part>>>,
    corners: Vec<Corners>,
    reference: Reference,
}

impl<'a> Judge<'a> {
    pub(super) fn new(tasks: &'a [PartTask], look: &MeshLook, looks: &Arc<Looks>) -> Self {
        let mut materials = look.materials.iter().map(|&material| looks.material(material));
        let mut part = |primitive| {
            let material = materials.next().expect("a look has a material for each primitive of the parts");
            Arc::new(Part::new(primitive, material))
        };
        let source: Vec<Vec<Arc<Part>>> =
            tasks.iter().map(|task| task.mesh.primitives.iter().map(&mut part).collect()).collect();
        let drawable = Drawable::of_parts(source.iter().flatten().cloned().collect(), looks.clone());
        let shot = Shot { size: look.size, faces: false };
        let reference = Reference::new(&Cpu, &drawable, drawable.frame(), &rhombicuboctahedron(), shot)
            .expect("the configuration allows only sizes that can be drawn");
        Self { tasks, size: look.size, looks: looks.clone(), source, corners: soup(&drawable).corners, reference }
    }

    /// The source itself. Faces are numbered part by part and primitive by primitive, as in the meshes.
    pub(super) fn source_drawable(&self) -> Drawable {
        Drawable::of_parts(self.source.iter().flatten().cloned().collect(), self.looks.clone())
    }

    /// Pixels on each side of the pictures.
    pub(super) fn size(&self) -> u32 {
        self.size
    }

    /// d_RMS of a level: one entry for each task, `None` = as the source.
    pub(super) fn difference(&self, levels: &[Option<Level>]) -> f64 {
        self.compare(&self.drawable(levels)).rms
    }

    /// Everything that is recorded of a level.
    pub(super) fn figures(&self, levels: &[Option<Level>]) -> LevelLook {
        let drawable = self.drawable(levels);
        let found = self.compare(&drawable);
        LevelLook {
            d_rms: found.rms,
            worst_view: found.views.get(found.worst).map_or(0.0, |view| view.rms),
            silhouette: found.silhouette,
            surface: SurfaceDistance::measure(&self.corners, &soup(&drawable).corners, self.samples()),
        }
    }

    fn samples(&self) -> usize {
        (self.corners.len() * SAMPLES_PER_TRIANGLE).clamp(SAMPLES.0, SAMPLES.1)
    }

    fn compare(&self, drawable: &Drawable) -> Comparison {
        self.reference.compare(&Cpu, drawable, false).expect("the source was drawn at the same size")
    }

    pub(super) fn drawable(&self, levels: &[Option<Level>]) -> Drawable {
        let mut parts = Vec::new();
        for ((task, source), level) in self.tasks.iter().zip(&self.source).zip(levels) {
            let Some(level) = level else {
                parts.extend(source.iter().cloned());
                continue;
            };
            for ((primitive, own), drawn) in level.primitives.iter().zip(&task.mesh.primitives).zip(source) {
                parts.push(Arc::new(Part::of_level(own, primitive, drawn.material)));
            }
        }
        Drawable::of_parts(parts, self.looks.clone())
    }
}
