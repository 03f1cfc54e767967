//! One wave of scenes: read and identify, plan, work, write.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;

use super::Session;
use super::record::{self, SceneFacts};
use super::recover::{Instance, Recovered, recover};
use super::seen;
use super::share::{self, Waiting};
use super::survey::Todo;
use super::write::{Written, write_scene};
use crate::appearance::assemble;
use crate::appearance::fingerprint::Fingerprints;
use crate::appearance::images::{ImageFacts, image_facts};
use crate::appearance::looks::Looks;
use crate::cache::{Bucket, Cache, Lookup};
use crate::emit::OutputFolder;
use crate::gltf::dependencies::{Dependency, DependencyKind, dependencies};
use crate::gltf::document::{Document, DocumentError};
use crate::gltf::fold::Folded;
use crate::gltf::lod::is_sealed;
use crate::gltf::scene::{Scene, SourceMesh};
use crate::gltf::share::Note;
use crate::identify::instances::{MeshUse, mesh_uses};
use crate::identify::{SubMesh, materials};
use crate::index::{self, Seen};
use crate::key::JobKey;
use crate::mesh::layout::frame;
use crate::obj::{self, is_obj};
use crate::plan::{MeshLook, MeshPlan, Plan};
use crate::progress::Event;
use crate::report::{PartsRecord, Problem, Severity, ShareRecord, Status};
use crate::scan::SceneFile;
use crate::work::{prepare, work};

/// Source bytes of one wave: what is in memory at a time is a small multiple of it, or of the largest scene.
const WAVE_BYTES: u64 = 256 << 20;

/// Splits scenes into waves, in order.
pub fn waves(todo: Vec<Todo>) -> Vec<Vec<Todo>> {
    let mut waves: Vec<Vec<Todo>> = Vec::new();
    let mut bytes = u64::MAX;
    for scene in todo {
        let size = scene.file.stat.size;
        bytes = bytes.saturating_add(size);
        if WAVE_BYTES < bytes {
            waves.push(Vec::new());
            bytes = size;
        }
        waves.last_mut().expect("the first scene opens a wave").push(scene);
    }
    waves
}

/// A scene that was read and identified.
pub struct ReadScene {
    pub todo: Todo,
    pub scene: Scene,
    /// By mesh.
    pub sub_meshes: Vec<Vec<SubMesh>>,
    /// Meshes that are others, moved, by mesh.
    pub instances: BTreeMap<usize, Instance>,
    /// Nodes that became batches.
    pub folded: Option<Folded>,
    /// Parts that were taken out of meshes, where that is asked for.
    pub parts: Option<PartsRecord>,
    /// Some of these are declared now: the document is not the source's.
    pub is_changed: bool,
    /// Of the search for them, and of budgets that cannot be met.
    pub notes: Vec<Note>,
    /// By mesh: nodes that show it.
    pub uses: Vec<MeshUse>,
    pub images: Vec<ImageFacts>,
    /// By mesh: radius of its bounding sphere.
    pub radii: Vec<f64>,
    /// By mesh, where looks are measured.
    looks: Vec<Option<MeshLook>>,
    /// By mesh; empty while meshes wait for their shares of a budget.
    pub plans: Vec<MeshPlan>,
    /// By mesh, where levels are budgets of the scene.
    pub waiting: Vec<Waiting>,
    /// By mesh, where levels are budgets of the scene: how large it is shown.
    pub scales: Vec<f64>,
    /// By mesh, where levels are budgets of the scene: what it gets of each.
    pub shares: Vec<Vec<ShareRecord>>,
    pub seen: Seen,
    pub dependencies: Vec<index::Dependency>,
    /// Scene file and buffers.
    pub bytes: u64,
}

/// Why a scene failed.
pub struct Failure {
    pub file: Box<SceneFile>,
    pub cause: String,
    pub hint: Option<String>,
}

impl Session<'_> {
    /// Reads, identifies and plans a wave. Scenes that cannot be read are told and left out.
    fn read_wave(&mut self, wave: Vec<Todo>) -> (Vec<ReadScene>, Plan) {
        let reporter = &self.context.reporter;
        let read: Vec<Result<ReadScene, Failure>> = wave
            .into_par_iter()
            .map(|todo| {
                reporter.event(&Event::SceneStarted { path: todo.file.relative.clone() });
                let scene = read_scene(todo)?;
                let meshes = scene.sub_meshes.iter().map(|subs| subs.len() as u64).sum();
                let path = scene.todo.file.relative.clone();
                reporter.event(&Event::SceneRead { path, bytes: scene.bytes, meshes });
                Ok(scene)
            })
            .collect();
        let mut plan = Plan::default();
        let mut scenes = Vec::new();
        for result in read {
            match result {
                Ok(mut scene) => {
                    self.summary.scene_bytes_read += scene.bytes;
                    let number = scenes.len();
                    scene.looks.iter_mut().flatten().for_each(|look| look.scene = number);
                    scene.plan(&mut plan);
                    scenes.push(scene);
                }
                Err(failure) => self.fail(failure),
            }
        }
        self.context.reporter.event(&Event::PlanFinished {
            found: scenes.iter().flat_map(|s| &s.sub_meshes).map(|subs| subs.len() as u64).sum(),
            distinct: scenes
                .iter()
                .flat_map(|s| s.sub_meshes.iter().flatten())
                .map(|s| s.hash)
                .collect::<BTreeSet<_>>()
                .len() as u64,
            jobs: plan.sequences.len() as u64,
            triangles: plan.sequences.values().map(|task| task.mesh.triangles() as u64).sum(),
        });
        (scenes, plan)
    }

    /// Reads a wave and tells what would be done with it.
    pub fn plan_only(&mut self, wave: Vec<Todo>) {
        let (scenes, plan) = self.read_wave(wave);
        for scene in scenes {
            let chains: BTreeSet<JobKey> = scene.chain_keys().collect();
            let wanted = chains.iter().filter(|key| !is_cached(&self.cache, Bucket::Chains, key));
            // What meshes would share is not known without the sequences: they are needed in any case.
            let waiting = scene.waiting.iter().flatten().flatten();
            let parts = wanted.flat_map(|key| &plan.chains[key].parts).chain(waiting);
            let sequences: BTreeSet<JobKey> = parts.flat_map(|part| part.sequences.iter().copied()).collect();
            let jobs = sequences.iter().filter(|key| !is_cached(&self.cache, Bucket::Sequences, key)).count();
            let (path, reason) = (scene.todo.file.relative.clone(), scene.todo.reason.clone());
            self.context.reporter.event(&Event::ScenePlanned { path, reason, jobs: jobs as u64 });
            self.summary.jobs += jobs as u64;
            self.summary.baked += 1;
        }
    }

    /// Bakes a wave.
    pub fn bake_wave(&mut self, wave: Vec<Todo>, output: &OutputFolder) {
        let (mut scenes, mut plan) = self.read_wave(wave);
        let prepared = prepare(&plan, &share::wanted(&scenes), &self.cache, &*self.context.reporter);
        for scene in &mut scenes {
            share::plan(scene, &mut plan, &prepared.sequences);
        }
        let load = |number: usize| scenes[number].load_looks();
        let baked = work(&plan, prepared, &self.cache, &load, &*self.context.reporter);
        self.summary.jobs += baked.jobs as u64;
        self.summary.cache_hits += baked.hits as u64;
        self.summary.looks_milliseconds += baked.looked.as_millis() as u64;
        for warning in &baked.warnings {
            self.warn_run(warning);
        }
        let root = &self.pipeline.output.path;
        let reporter = &self.context.reporter;
        let written: Vec<Result<Written, Failure>> = scenes
            .into_par_iter()
            .map(|scene| {
                let written = write_scene(scene, &baked, output, root)?;
                let path = written.todo.file.relative.clone();
                let changed = 0 < written.new_files;
                reporter.event(&Event::SceneWritten { path, bytes: written.facts.record.bytes_out, changed });
                Ok(written)
            })
            .collect();
        for result in written {
            match result {
                Ok(written) => self.take_written(written),
                Err(failure) => self.fail(failure),
            }
        }
    }

    fn take_written(&mut self, written: Written) {
        let Written { todo, mut facts, bake, new_files } = written;
        match facts.record.status {
            Status::Copied => self.summary.copied += 1,
            _ => self.summary.baked += 1,
        }
        self.summary.outputs_written += new_files;
        for problem in &facts.problems {
            self.summary.warnings += 1;
            let place = if problem.place.is_empty() { String::new() } else { format!("{}: ", problem.place) };
            let message = format!("`{}`: {place}{}", todo.file.relative, problem.cause);
            self.context.reporter.event(&Event::Warning { message, hint: problem.hint.clone() });
        }
        if todo.settings != self.pipeline.settings() {
            facts.record.settings = Some(todo.settings.clone());
        }
        let bake = index::Bake { facts: record::to_bytes(&facts), ..bake };
        self.index.record(&todo.file.relative, &todo.key, bake);
        self.scenes.insert(todo.file.relative.clone(), facts);
    }

    fn fail(&mut self, failure: Failure) {
        let Failure { file, cause, hint } = failure;
        self.summary.failed += 1;
        let (path, error) = (file.relative.clone(), cause.clone());
        self.context.reporter.event(&Event::SceneFailed { path, error, hint: hint.clone() });
        let scene = Some(file.relative.clone());
        let problem = Problem { scene, severity: Severity::Error, place: String::new(), cause, hint };
        self.index.forget(&file.relative);
        self.scenes.insert(file.relative.clone(), SceneFacts::failed(&file, problem));
    }
}

impl ReadScene {
    fn chain_keys(&self) -> impl Iterator<Item = JobKey> + '_ {
        self.plans.iter().filter_map(|plan| match plan {
            MeshPlan::Chain { chain, .. } => Some(*chain),
            MeshPlan::Alone(_) => None,
        })
    }
}

impl ReadScene {
    /// Adds what the scene's meshes need.
    fn plan(&mut self, plan: &mut Plan) {
        let settings = &self.todo.settings;
        let meshes = || self.scene.meshes.iter().zip(&self.sub_meshes);
        let is_sealed = |source: &SourceMesh| is_sealed(&self.scene.document, source.index);
        if settings.shares_a_budget() {
            let parts = |(source, subs): (&SourceMesh, &Vec<SubMesh>)| match self.shown_elsewhere(source.index) {
                Some(why) => Err(why),
                None if self.uses[source.index].instances == 0 => Err("no node shows it"),
                None => plan.parts(source, subs, is_sealed(source), settings),
            };
            self.waiting = meshes().map(parts).collect();
            return;
        }
        let plans = |(source, subs): (&SourceMesh, &Vec<SubMesh>)| match self.shown_elsewhere(source.index) {
            Some(why) => MeshPlan::Alone(why),
            None => plan.add(source, subs, is_sealed(source), self.look(source.index), settings),
        };
        self.plans = meshes().map(plans).collect();
    }

    /// What a mesh looks like, where that is measured.
    pub fn look(&self, mesh: usize) -> Option<&MeshLook> {
        self.looks[mesh].as_ref()
    }

    /// Why a mesh has no levels of its own, if its nodes show the one that it is an instance of.
    fn shown_elsewhere(&self, mesh: usize) -> Option<&'static str> {
        let declared = self.instances.get(&mesh).is_some_and(|instance| instance.kept.is_none());
        (declared && self.uses[mesh].nodes == 0).then_some("its nodes show the mesh that it repeats")
    }

    /// Materials and textures. What is missing is told by the warnings of the scene's record.
    fn load_looks(&self) -> Arc<Looks> {
        assemble::looks(&self.scene, self.todo.file.path.parent().unwrap_or(Path::new("")))
    }
}

/// What each mesh looks like, where the settings ask for it.
fn mesh_looks(
    scene: &Scene,
    sub_meshes: &[Vec<SubMesh>],
    beside: &[(PathBuf, index::Dependency)],
    todo: &Todo,
) -> Vec<Option<MeshLook>> {
    let settings = &todo.settings;
    if !settings.appearance.record && !settings.looks_decide() {
        return vec![None; scene.meshes.len()];
    }
    let external = |address: &str| {
        let path = &scene.dependencies.iter().find(|dependency| dependency.uri == address)?.path;
        Some(beside.iter().find(|(found, _)| found == path)?.1.seen.as_ref()?.content)
    };
    let fingerprints = Fingerprints::new(&scene.document, &scene.buffers, &external);
    let look = |source: &SourceMesh| {
        let materials = materials(&scene.document, source.index, &sub_meshes[source.index]);
        let hash = fingerprints.of(&materials);
        Some(MeshLook { scene: 0, hash, materials: Arc::new(materials), size: settings.appearance.size })
    };
    scene.meshes.iter().map(look).collect()
}

fn read_scene(todo: Todo) -> Result<ReadScene, Failure> {
    let file = &todo.file;
    let failure = |cause: String, hint: Option<&str>| Failure {
        file: Box::new(file.clone()),
        cause,
        hint: hint.map(str::to_owned),
    };
    let base = file.path.parent().unwrap_or(Path::new(""));
    let converted = is_obj(&file.path);
    // Files are looked at before they are read: one that changes in between is found by the next bake.
    let bytes = std::fs::read(&file.path)
        .map_err(|error| failure(format!("failed to read `{}`: {error}", file.path.display()), None))?;
    let seen = Seen::of(file.stat, &bytes);
    let named = Document::parse(&bytes).map(|document| dependencies(&document, base)).unwrap_or_default();
    let mut beside = see(base, &named);
    let scene = obj::read_any(&file.path).map_err(|error| failure(error.to_string(), error.hint()))?;
    if converted {
        beside = see(base, &scene.dependencies);
    }
    let refused =
        |error: DocumentError| failure(format!("failed to read `{}`: {error}", file.path.display()), error.hint());
    let buffers: u64 = (scene.dependencies.iter())
        .filter(|d| d.kind == DependencyKind::Buffer)
        .filter_map(|d| beside.iter().find(|(path, _)| *path == d.path)?.1.seen.as_ref())
        .map(|seen| seen.stat.size)
        .sum();
    let Recovered { scene, sub_meshes, instances, parts, folded, is_changed, notes } =
        recover(scene, &todo.settings.instances, base).map_err(refused)?;
    let uses = mesh_uses(&scene.document).map_err(refused)?;
    let scales = if todo.settings.shares_a_budget() {
        seen::scales(&scene, &todo.settings.scene).map_err(refused)?
    } else {
        Vec::new()
    };
    Ok(ReadScene {
        instances,
        folded,
        parts,
        is_changed,
        notes,
        looks: mesh_looks(&scene, &sub_meshes, &beside, &todo),
        images: image_facts(&scene.document, &scene.buffers, base),
        uses,
        radii: scene.meshes.iter().map(radius).collect(),
        plans: Vec::new(),
        waiting: Vec::new(),
        scales,
        shares: Vec::new(),
        bytes: bytes.len() as u64 + buffers,
        sub_meshes,
        seen,
        dependencies: beside.into_iter().map(|(_, dependency)| dependency).collect(),
        scene,
        todo,
    })
}

fn is_cached(cache: &Cache, bucket: Bucket, key: &JobKey) -> bool {
    matches!(cache.get(bucket, key), Lookup::Hit(_))
}

/// State and content of files beside a scene, by path.
fn see(base: &Path, files: &[Dependency]) -> Vec<(PathBuf, index::Dependency)> {
    let relative = |path: &Path| {
        let below = path.strip_prefix(base).unwrap_or(path);
        below.components().map(|c| c.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
    };
    let mut seen: Vec<(PathBuf, index::Dependency)> = files
        .iter()
        .map(|d| (d.path.clone(), index::Dependency { relative: relative(&d.path), seen: Seen::read(&d.path).ok() }))
        .collect();
    seen.sort_by(|a, b| a.0.cmp(&b.0));
    seen.dedup_by(|a, b| a.0 == b.0);
    seen
}

/// Radius of the bounding sphere of a mesh: half the diagonal of the box of its triangles' primitives.
fn radius(source: &SourceMesh) -> f64 {
    frame(source.triangle_primitives().map(|(_, primitive)| primitive)).1
}
