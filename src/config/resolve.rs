//! From the file's keys to settings: defaults, overrides on top of each other, and the rules that need more than one
//! key to tell.

use std::path::{Component, Path, PathBuf};

use super::check::Document;
use super::choice::{ErrorUnit, Layout, Placement, Recover, Storage};
use super::error::{ConfigError, Place};
use super::file::{
    AppearanceTable, InstancesTable, LodEntry, OneOrMany, OverrideEntry, PipelineFile, SceneTable, ScreenTable,
    SimplifyTable,
};
use super::globs::Globs;
use super::settings::{
    AppearanceSettings, ChainSettings, EmitSettings, InstanceSettings, LevelTarget, SceneSettings, Screen,
    SimplifySettings, ViewSettings, Weights,
};
use super::{Folder, Pipeline, budget, defaults};

/// The settings that an override may change; an absent key leaves what is below it.
#[derive(Clone, Debug, Default)]
pub(super) struct Layer {
    skip: Option<bool>,
    format: Option<super::Format>,
    storage: Option<Storage>,
    layout: Option<Layout>,
    profile: Option<super::Profile>,
    vertex_cache: Option<bool>,
    screen: ScreenTable,
    simplify: SimplifyTable,
    appearance: AppearanceTable,
    instances: InstancesTable,
    scene: SceneTable,
    lod: Option<Vec<LodEntry>>,
}

/// Lays `over` on `under`, for the named fields.
macro_rules! lay {
    ($over:expr, $under:expr; $($field:ident),+) => { $( if $over.$field.is_some() { $under.$field.clone_from(&$over.$field); } )+ };
}

impl Layer {
    /// Keys of `over` win.
    pub fn lay(&mut self, over: &Self) {
        lay!(over, self; skip, format, storage, layout, profile, vertex_cache, lod);
        lay!(over.screen, self.screen; pixels, height, fov);
        lay!(over.simplify, self.simplify; metric, effort, normal, texcoord, color, border, seam, crease);
        lay!(over.simplify, self.simplify; placement, min_triangles, lock_border, candidates);
        lay!(over.appearance, self.appearance; record, size);
        lay!(over.scene, self.scene; cameras, distances);
        lay!(over.instances, self.instances; recover, tolerance, split, instancing, cell, names, required);
    }

    /// Fills what is still absent with defaults.
    pub fn settle(&self) -> SceneSettings {
        let storage = self.storage.unwrap_or_default();
        let (levels, coverage) = match &self.lod {
            Some(entries) => {
                (entries.iter().filter_map(target).collect(), entries.iter().map(|e| e.coverage).collect())
            }
            None => (defaults::RATIOS.map(LevelTarget::Ratio).to_vec(), None),
        };
        let mut settings = SceneSettings {
            skip: self.skip.unwrap_or(false),
            min_triangles: self.simplify.min_triangles.unwrap_or(defaults::MIN_TRIANGLES) as usize,
            simplify: self.simplify_settings(storage),
            chain: ChainSettings { levels, storage, vertex_cache: self.vertex_cache.unwrap_or(true) },
            emit: EmitSettings {
                format: self.format.unwrap_or_default(),
                layout: self.layout.unwrap_or_default(),
                profile: self.profile.unwrap_or_default(),
                screen: Screen {
                    pixels: self.screen.pixels.unwrap_or(defaults::PIXELS),
                    height: self.screen.height.unwrap_or(defaults::SCREEN_HEIGHT),
                    fov: self.screen.fov.unwrap_or(defaults::FIELD_OF_VIEW),
                },
                coverage,
            },
            appearance: AppearanceSettings {
                record: self.appearance.record.unwrap_or(true),
                size: self.appearance.size.unwrap_or(defaults::LOOK_SIZE),
            },
            instances: InstanceSettings {
                recover: self.instances.recover.unwrap_or_default(),
                tolerance: self.instances.tolerance.unwrap_or(defaults::TOLERANCE),
                // An override that recovers nothing takes nothing apart.
                split: self.instances.split.unwrap_or(false) && self.moves_instances(),
                instancing: self.instances.instancing.unwrap_or_default(),
                cell: self.instances.cell.unwrap_or(defaults::CELL),
                names: self.instances.names.unwrap_or_default(),
                // The profile promises a file without required extensions.
                required: self.instances.required.unwrap_or(self.profile != Some(super::Profile::Core)),
            },
            scene: ViewSettings {
                cameras: self.scene.cameras.clone().unwrap_or_default(),
                distances: self.scene.distances.clone().unwrap_or_default(),
            },
        };
        if self.appearance.size.is_none() && settings.looks_decide() {
            settings.appearance.size = defaults::DECIDING_LOOK_SIZE;
        }
        settings
    }

    /// May instances be moved?
    fn moves_instances(&self) -> bool {
        Recover::Rigid <= self.instances.recover.unwrap_or_default()
    }

    fn simplify_settings(&self, storage: Storage) -> SimplifySettings {
        let table = &self.simplify;
        SimplifySettings {
            metric: table.metric.unwrap_or_default(),
            effort: table.effort.unwrap_or_default(),
            weights: Weights {
                normal: table.normal.unwrap_or(defaults::NORMAL),
                texcoord: table.texcoord.unwrap_or(defaults::TEXCOORD),
                color: table.color.unwrap_or(defaults::COLOR),
                border: table.border.unwrap_or(defaults::BORDER),
                seam: table.seam.unwrap_or(defaults::SEAM),
                crease: table.crease.unwrap_or(defaults::CREASE),
            },
            placement: match storage {
                Storage::Shared => Placement::Subset,
                _ if !table.metric.unwrap_or_default().moves_vertices() => Placement::Subset,
                _ => table.placement.unwrap_or_default(),
            },
            lock_border: table.lock_border.unwrap_or(false),
            candidates: table.candidates.unwrap_or(defaults::CANDIDATES),
        }
    }
}

impl SceneSettings {
    /// The defaults, but for what `[simplify]` says.
    pub(crate) fn simplified_by(simplify: &SimplifyTable) -> Self {
        Layer { simplify: simplify.clone(), ..Layer::default() }.settle()
    }
}

/// The whole pipeline; `file` is its path.
pub(super) fn pipeline(document: &Document<'_>, file: &str) -> Result<Pipeline, ConfigError> {
    let typed: PipelineFile = document.typed()?;
    let base = Path::new(file).parent().unwrap_or(Path::new("")).to_path_buf();
    let top = Place::default();
    let (inputs, output) = folders(document, &typed, &base)?;
    let include = typed.include.map_or_else(|| defaults::INCLUDE.map(str::to_owned).to_vec(), OneOrMany::into_vec);
    let include = globs(document, &top.key("include"), include)?;
    let exclude = globs(document, &top.key("exclude"), typed.exclude.map(OneOrMany::into_vec).unwrap_or_default())?;
    let cache = Folder::below(&base, typed.cache.unwrap_or_else(|| defaults::CACHE.to_owned()));
    let layer = Layer {
        skip: None,
        format: typed.format,
        storage: typed.storage,
        layout: typed.layout,
        profile: typed.profile,
        vertex_cache: typed.vertex_cache,
        screen: typed.screen.unwrap_or_default(),
        simplify: typed.simplify.unwrap_or_default(),
        appearance: typed.appearance.unwrap_or_default(),
        instances: typed.instances.unwrap_or_default(),
        scene: typed.scene.unwrap_or_default(),
        lod: typed.lod,
    };
    check_layer(document, &top, &layer)?;
    check_split(document, &top, &layer, &layer)?;
    let mut overrides = Vec::new();
    for (i, entry) in typed.overrides.unwrap_or_default().into_iter().enumerate() {
        let place = top.key("override").index(i);
        let (globs, over) = override_layer(document, &place, entry)?;
        let mut laid = layer.clone();
        laid.lay(&over);
        check_split(document, &place, &over, &laid)?;
        overrides.push((globs, over));
    }
    let mut budgets = Vec::new();
    for (i, entry) in typed.budget.unwrap_or_default().into_iter().enumerate() {
        budgets.push(budget::resolve(document, &top.key("budget").index(i), entry)?);
    }
    Ok(Pipeline {
        file: file.to_owned(),
        inputs,
        output,
        include,
        exclude,
        ignore_files: typed.ignore_files.unwrap_or(false),
        follow_links: typed.follow_links.unwrap_or(true),
        cache,
        jobs: typed.jobs.unwrap_or(0) as usize,
        budgets,
        baseline: typed.baseline.map(|written| Folder::below(&base, written)),
        layer,
        overrides,
    })
}

fn override_layer(document: &Document<'_>, place: &Place, entry: OverrideEntry) -> Result<(Globs, Layer), ConfigError> {
    let globs = globs(document, &place.key("match"), entry.matching.into_vec())?;
    let layer = Layer {
        skip: entry.skip,
        format: entry.format,
        storage: entry.storage,
        layout: entry.layout,
        profile: entry.profile,
        vertex_cache: entry.vertex_cache,
        screen: entry.screen.unwrap_or_default(),
        simplify: entry.simplify.unwrap_or_default(),
        appearance: entry.appearance.unwrap_or_default(),
        instances: entry.instances.unwrap_or_default(),
        scene: entry.scene.unwrap_or_default(),
        lod: entry.lod,
    };
    check_layer(document, place, &layer)?;
    Ok((globs, layer))
}

pub(super) fn globs(document: &Document<'_>, place: &Place, patterns: Vec<String>) -> Result<Globs, ConfigError> {
    let written = patterns.clone();
    Globs::new(patterns).map_err(|(index, cause)| {
        let pattern = written.get(index).map_or("", String::as_str);
        document.invalid(&place.index(index), format!("`{pattern}` is not a glob: {cause}"))
    })
}

/// Rules within one table and its `[[lod]]` list.
fn check_layer(document: &Document<'_>, place: &Place, layer: &Layer) -> Result<(), ConfigError> {
    if layer.storage == Some(Storage::Shared) && layer.simplify.placement == Some(Placement::Optimal) {
        let place = place.key("simplify").key("placement");
        return Err(document.invalid(&place, "`optimal` moves vertices, so the levels cannot use storage `shared`"));
    }
    if let Some(metric) = layer.simplify.metric.filter(|metric| !metric.moves_vertices())
        && layer.simplify.placement == Some(Placement::Optimal)
    {
        let place = place.key("simplify").key("placement");
        let cause = format!("`optimal` is not for metric `{metric}`, which puts vertices onto one of the two ends");
        return Err(document.invalid(&place, cause));
    }
    let place = place.key("lod");
    let entries = layer.lod.as_deref().unwrap_or_default();
    for (i, entry) in entries.iter().enumerate() {
        let place = place.index(i);
        if target(entry).is_none() {
            let text = "must have exactly one of `ratio`, `triangles`, `error`, `pixels`, `appearance`, `scene_ratio`, \
                        `scene_triangles` and `scene_bytes`";
            return Err(document.invalid(&place, text));
        }
        if entry.unit.is_some() && entry.error.is_none() {
            return Err(document.invalid(&place.key("unit"), "is the unit of `error`, which this level does not have"));
        }
        if entry.size.is_some() != entry.pixels.is_some() {
            let text = "needs `pixels` and `size` together: the error in pixels of a mesh that is `size` pixels high";
            return Err(document.invalid(&place, text));
        }
        if let Some(cause) = entries[..i].iter().rev().find_map(|finer| not_coarser(finer, entry)) {
            return Err(document.invalid(&place, cause));
        }
    }
    let given = entries.iter().filter(|entry| entry.coverage.is_some()).count();
    if given != 0 && given != entries.len() {
        let cause = format!("has `coverage` for {given} of {} levels: give it for all or for none", entries.len());
        return Err(document.invalid(&place, cause));
    }
    Ok(())
}

/// Parts of one mesh are never at the same place: what asks for them has to ask for instances that are moved.
fn check_split(document: &Document<'_>, place: &Place, layer: &Layer, laid: &Layer) -> Result<(), ConfigError> {
    if layer.instances.split == Some(true) && !laid.moves_instances() {
        let place = place.key("instances").key("split");
        return Err(document.invalid(&place, "needs `recover` to be \"rigid\", \"similar\" or \"mirrored\""));
    }
    Ok(())
}

/// Exactly one of them, or `None`.
fn target(entry: &LodEntry) -> Option<LevelTarget> {
    let unit = entry.unit.unwrap_or_default();
    let given = [
        entry.ratio.map(LevelTarget::Ratio),
        entry.triangles.map(LevelTarget::Triangles),
        entry.error.map(|limit| LevelTarget::Error { limit, unit }),
        // Without `size`, which is checked apart, any height will do.
        entry.pixels.map(|limit| LevelTarget::Pixels { limit, size: entry.size.unwrap_or(1.0) }),
        entry.appearance.map(LevelTarget::Appearance),
        entry.scene_ratio.map(LevelTarget::SceneRatio),
        entry.scene_triangles.map(LevelTarget::SceneTriangles),
        entry.scene_bytes.map(LevelTarget::SceneBytes),
    ];
    let mut given = given.into_iter().flatten();
    given.next().filter(|_| given.next().is_none())
}

/// Why `entry` is not coarser than the `finer` level before it, where that can be told.
fn not_coarser(finer: &LodEntry, entry: &LodEntry) -> Option<String> {
    let descends = |what: &str, before: String, now: String| {
        format!("has {what} {now} after {before}: levels go from fine to coarse, {what} must become smaller")
    };
    if let (Some(before), Some(now)) = (finer.coverage, entry.coverage)
        && now >= before
    {
        return Some(descends("coverage", before.to_string(), now.to_string()));
    }
    match (target(finer)?, target(entry)?) {
        (LevelTarget::Ratio(before), LevelTarget::Ratio(now)) if now >= before => {
            Some(descends("ratio", before.to_string(), now.to_string()))
        }
        (LevelTarget::Triangles(before), LevelTarget::Triangles(now)) if now >= before => {
            Some(descends("triangles", before.to_string(), now.to_string()))
        }
        (LevelTarget::SceneRatio(before), LevelTarget::SceneRatio(now)) if now >= before => {
            Some(descends("scene_ratio", before.to_string(), now.to_string()))
        }
        (LevelTarget::SceneTriangles(before), LevelTarget::SceneTriangles(now)) if now >= before => {
            Some(descends("scene_triangles", before.to_string(), now.to_string()))
        }
        (LevelTarget::SceneBytes(before), LevelTarget::SceneBytes(now)) if now >= before => {
            Some(descends("scene_bytes", before.to_string(), now.to_string()))
        }
        (LevelTarget::Error { limit: before, unit: old }, LevelTarget::Error { limit: now, unit })
            if old == unit && now <= before =>
        {
            let unit = if unit == ErrorUnit::Object { " object units" } else { "" };
            Some(format!("has error {now} after {before}{unit}: levels go from fine to coarse, error must grow"))
        }
        (LevelTarget::Pixels { limit: before, size: old }, LevelTarget::Pixels { limit: now, size })
            if now / size <= before / old =>
        {
            let words = "levels go from fine to coarse, pixels must grow or size must become smaller";
            Some(format!("has {now} pixels at {size} after {before} at {old}: {words}"))
        }
        (LevelTarget::Appearance(before), LevelTarget::Appearance(now)) if now <= before => Some(format!(
            "has appearance {now} after {before}: levels go from fine to coarse, the difference must grow"
        )),
        _ => None,
    }
}

/// Input and output folders, which must not swallow each other.
fn folders(document: &Document<'_>, typed: &PipelineFile, base: &Path) -> Result<(Vec<Folder>, Folder), ConfigError> {
    let top = Place::default();
    let output = Folder::below(base, typed.output.clone());
    let many = matches!(typed.input, OneOrMany::Many(_));
    let mut inputs: Vec<Folder> = Vec::new();
    for (i, written) in typed.input.clone().into_vec().into_iter().enumerate() {
        let place = if many { top.key("input").index(i) } else { top.key("input") };
        let input = Folder::below(base, written);
        let plain = lexical(&input.path);
        let out = lexical(&output.path);
        if plain == out {
            return Err(document.invalid(&place, format!("`{input}` is also the output: scenes would be overwritten")));
        }
        if plain.starts_with(&out) {
            return Err(
                document.invalid(&place, format!("`{input}` lies in the output `{output}`, which is not scanned"))
            );
        }
        if inputs.iter().any(|other| lexical(&other.path) == plain) {
            return Err(document.invalid(&place, format!("`{input}` is given twice")));
        }
        inputs.push(input);
    }
    if inputs.is_empty() {
        return Err(document.invalid(&top.key("input"), "is empty: name at least one folder"));
    }
    Ok((inputs, output))
}

/// Without `.` and `..`; links are not followed, as the folders need not exist yet.
fn lexical(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let mut plain = PathBuf::new();
    for component in absolute.components() {
        match component {
            Component::ParentDir => {
                plain.pop();
            }
            Component::CurDir => {}
            other => plain.push(other),
        }
    }
    plain
}
