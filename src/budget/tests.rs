//! Limits and growth, by example: what is found, how it is told, in which order.

use std::collections::BTreeSet;

use super::*;
use crate::config::{LevelTarget, Pipeline};
use crate::report::{ImageRecord, LevelRecord, OutputRecord, SceneCosts, Status, Stop};

/// A scene with two meshes: one with levels of 500 and 250 triangles, one that repeats it without levels.
pub(crate) fn scene(path: &str) -> SceneRecord {
    let level = |number: u64, triangles: u64, d_rms: f64| LevelRecord {
        number,
        target: LevelTarget::Ratio(0.5),
        triangles,
        vertices: triangles / 2,
        bytes: 6 * triangles,
        error: 0.02,
        error_of_radius: 0.01,
        coverage: 0.5,
        distance: 12.5,
        stop: Stop::Target,
        recipe: None,
        d_rms: Some(d_rms),
        worst_view: Some(d_rms),
        silhouette: Some(0.01),
        surface: None,
    };
    let mesh = |index, name: &str, levels: Vec<LevelRecord>| MeshRecord {
        index,
        name: Some(name.into()),
        instances: 3,
        draw_calls: 6,
        copy_of: (index == 1).then_some(0),
        instance_of: None,
        shares: Vec::new(),
        triangles: 1000,
        vertices: 600,
        radius: 2.0,
        pieces: vec![],
        levels,
        notes: if index == 1 { vec!["no levels: it is sealed".into()] } else { vec![] },
    };
    let image =
        |name: &str, bytes, side| ImageRecord { name: Some(name.into()), bytes, width: Some(side), height: Some(8) };
    SceneRecord {
        path: path.into(),
        status: Status::Baked,
        settings: None,
        bytes_in: 10_000,
        bytes_out: 20_000,
        outputs: vec![OutputRecord { path: path.into(), bytes: 20_000, hash: String::new() }],
        meshes: vec![mesh(0, "shade", vec![level(1, 500, 2.0), level(2, 250, 6.0)]), mesh(1, "twin", vec![])],
        costs: Some(SceneCosts {
            draw_calls: 12,
            materials: 4,
            geometry_bytes: 15_000,
            images: vec![image("wood", 4_000, 512), image("paint", 1_000, 2048)],
        }),
        batches: None,
        parts: None,
    }
}

fn found(budgets: &str, scene: &SceneRecord, base: Option<&SceneRecord>) -> Vec<Finding> {
    let pipeline = Pipeline::parse(&format!("input = 'a'\noutput = 'b'\n{budgets}"), "pipeline.toml").unwrap();
    let mut found = check(scene, &pipeline.budgets, 64, base);
    sort(&mut found);
    found
}

fn told(budgets: &str, base: Option<&SceneRecord>) -> String {
    let line = |f: &Finding| format!("{:?} {}: {} ({})\n", f.severity, f.place(), f.message, f.help);
    found(budgets, &scene("props/lamp.glb"), base).iter().map(line).collect()
}

#[test]
fn within_the_limits_nothing_is_found() {
    let limits = "[[budget]]\ntriangles = 1000\nvertices = 600\nd_rms = 6\nlevels = 2\nscene_triangles = 6000\n\
                  distinct_triangles = 2000\ndraw_calls = 12\nmaterials = 4\ntexture_size = 2048\nfile_bytes = 20000\n\
                  geometry_bytes = 15000\ntexture_bytes = 5000\nundeclared = 1\nscene_vertices = 1200";
    assert_eq!(told(limits, None), "");
    let stricter: String = limits
        .lines()
        .map(|line| match line.split_once(" = ") {
            Some((key, number)) => format!("{key} = {}\n", number.parse::<u64>().unwrap() - 1),
            None => format!("{line}\n"),
        })
        .collect();
    let rules: BTreeSet<String> =
        found(&stricter, &scene("a.glb"), None).into_iter().map(|f| f.rule.replace("budget/", "")).collect();
    let keys: BTreeSet<String> = limits.lines().filter_map(|l| Some(l.split_once(" = ")?.0.to_owned())).collect();
    assert_eq!(rules, keys);
}

#[test]
fn a_finding_says_where_how_much_and_what_would_help() {
    insta::assert_snapshot!(told("[[budget]]\nlevel = [1, 2]\ntriangles = { warn = 200, error = 400 }", None), @r"
    Error props/lamp.glb: mesh `shade`, level 1: 500 triangles; limit 400, 25 % over (`ratio = 0.4` instead of 0.5 for level 1 would reach it)
    Warning props/lamp.glb: mesh `shade`, level 2: 250 triangles; limit 200, 25 % over (`ratio = 0.2` instead of 0.5 for level 2 would reach it)
    ");
    insta::assert_snapshot!(told("[[budget]]\nlevel = [0]\nscene_triangles = 4000\ntriangles = 999", None), @r"
    Error props/lamp.glb: 6,000 triangles with every instance; limit 4,000, 50 % over (`twin` takes the most (1,000 × 3 instances): a coarser source, or fewer instances)
    Error props/lamp.glb: mesh `shade`, source: 1,000 triangles; limit 999, 0.10 % over (this is the source: make it coarser where it is modelled, or name the levels that the limit holds for, e.g. `level = [1, 2]`)
    Error props/lamp.glb: mesh `twin`, source: 1,000 triangles; limit 999, 0.10 % over (this is the source: make it coarser where it is modelled, or name the levels that the limit holds for, e.g. `level = [1, 2]`)
    ");
    insta::assert_snapshot!(told("[[budget]]\nd_rms = { warn = 5 }\nmin_levels = 1\nundeclared = 0", None), @r#"
    Error props/lamp.glb: 1 repeated mesh; limit 0 (`twin` repeats `shade`: `recover = "exact"` in `[instances]` makes instances of such meshes)
    Error props/lamp.glb: mesh `twin`: 0 levels; at least 1 (no levels: it is sealed)
    Warning props/lamp.glb: mesh `shade`, level 2: d_RMS 6.00; limit 5.00, 20 % over (ask for a higher ratio than 0.5 at level 2, a level by `appearance`, or try `effort = "best"`)
    "#);
    insta::assert_snapshot!(told("[[budget]]\ntexture_size = 1024\ntexture_bytes = 4500\nfile_bytes = 19000\ndraw_calls = 3\nmaterials = 2", None), @r#"
    Error props/lamp.glb: 12 draw calls; limit 3, 4.0 times that (`twin` takes 6: join parts with the same material, or use `EXT_mesh_gpu_instancing`)
    Error props/lamp.glb: 4 materials; limit 2, 2.0 times that (join materials that differ by their textures alone in an atlas)
    Error props/lamp.glb: a texture of 2,048 texels; limit 1,024, 2.0 times that (resize `paint` (2048×8))
    Error props/lamp.glb: 5.00 kB of textures; limit 4.50 kB, 11 % over (`wood` is the largest (4.00 kB): resize or compress it)
    Error props/lamp.glb: 20.0 kB of files; limit 19.0 kB, 5.3 % over (geometry is 15.0 kB, of which levels about 4.50 kB, textures are 5.00 kB; fewer levels, or `storage = "shared"`, make levels smaller)
    "#);
}

#[test]
fn later_budgets_win() {
    let budgets = "[[budget]]\nd_rms = 1\n[[budget]]\nmatch = 'props/**'\nd_rms = 5\n[[budget]]\nmatch = 'props/**'\nlevel = [2]\nd_rms = 7";
    assert_eq!(told(budgets, None), "");
    assert_eq!(found(budgets, &scene("hall.glb"), None).len(), 2);
}

#[test]
fn growth_is_against_the_baseline() {
    let mut base = scene("props/lamp.glb");
    base.meshes[0].levels[1].d_rms = Some(5.0);
    base.outputs[0].bytes = 18_000;
    let limits = "[[budget]]\nd_rms = { grow_percent = { warn = 10, error = 19 } }\nfile_bytes = { grow_by = 1000 }";
    insta::assert_snapshot!(told(limits, Some(&base)), @r#"
    Error props/lamp.glb: 20.0 kB of files, 2.00 kB more than the baseline's 18.0 kB; limit 1.00 kB (geometry is 15.0 kB, of which levels about 4.50 kB, textures are 5.00 kB; fewer levels, or `storage = "shared"`, make levels smaller)
    Error props/lamp.glb: mesh `shade`, level 2: d_RMS 6.00, 20 % more than the baseline's 5.00; limit 19 % (ask for a higher ratio than 0.5 at level 2, a level by `appearance`, or try `effort = "best"`)
    "#);
    assert_eq!(told(limits, None), "");
    assert_eq!(told(limits, Some(&scene("props/lamp.glb"))), "");
    let looser = "[[budget]]\nd_rms = { grow_percent = { warn = 10, error = 21 } }\nfile_bytes = { grow_percent = 12 }";
    let severities: Vec<_> =
        found(looser, &scene("props/lamp.glb"), Some(&base)).into_iter().map(|f| f.severity).collect();
    assert_eq!(severities, [Severity::Warning]);
    assert!(needs_baseline(&Pipeline::parse(&format!("input = 'a'\noutput = 'b'\n{limits}"), "p").unwrap().budgets));
}

#[test]
fn meshes_are_matched_by_name_then_by_number() {
    let (a, mut b) = (scene("a").meshes, scene("a").meshes);
    b.reverse();
    (b[0].index, b[1].index) = (0, 1);
    let same = matching(&a, &b);
    assert_eq!([same[&0].index, same[&1].index], [1, 0]);
    for mesh in &mut b {
        mesh.name = None;
    }
    assert!(matching(&a, &b).is_empty());
}
