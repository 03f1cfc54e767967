//! What the file, its errors and its ranges mean, by example.

use std::fmt::Write;

use super::*;

fn parse(text: &str) -> Result<Pipeline, ConfigError> {
    Pipeline::parse(text, "project/pipeline.toml")
}

fn minimal(rest: &str) -> Result<Pipeline, ConfigError> {
    parse(&format!("input = \"scenes\"\noutput = \"out\"\n{rest}"))
}

/// What a person reads.
fn refused(rest: &str) -> String {
    let error = minimal(rest).expect_err("must be refused");
    match error.hint() {
        Some(hint) => format!("{error}\nhint: {hint}"),
        None => error.to_string(),
    }
}

#[test]
fn defaults_of_the_shortest_pipeline() {
    let pipeline = minimal("").unwrap();
    assert_eq!(pipeline.inputs[0].path, Path::new("project/scenes"));
    assert_eq!(pipeline.output.path, Path::new("project/out"));
    assert_eq!(pipeline.cache.path, Path::new("project/.lodbake"));
    assert_eq!(pipeline.include.patterns(), defaults::INCLUDE);
    assert!(pipeline.exclude.patterns().is_empty());
    assert!(!pipeline.ignore_files);
    assert!(pipeline.follow_links);
    assert_eq!(pipeline.jobs, 0);
    let settings = pipeline.settings();
    assert_eq!(settings.simplify, SimplifySettings::default());
    assert_eq!(settings.emit, EmitSettings::default());
    assert_eq!(settings.chain.levels, defaults::RATIOS.map(LevelTarget::Ratio));
    assert!(settings.chain.vertex_cache);
    assert_eq!(settings.min_triangles, 64);
    assert_eq!(settings, pipeline.settings_for("any.glb"));
}

#[test]
fn paths_are_relative_to_the_file() {
    let text = "input = 'a'\noutput = '../b'\ncache = 'c'";
    let pipeline = Pipeline::parse(text, "pipeline.toml").unwrap();
    assert_eq!(pipeline.cache, Folder { written: "c".to_owned(), path: "c".into() });
    assert_eq!(parse(text).unwrap().output.path, Path::new("project/../b"));
}

#[test]
fn unknown_keys_name_the_nearest() {
    insta::assert_snapshot!(refused("sotrage = 'shared'"), @"unknown key `sotrage` in `project/pipeline.toml` line 3 (did you mean `storage`? known: `input`, `output`, `include`, `exclude`, `ignore_files`, `follow_links`, `cache`, `jobs`, `format`, `storage`, `layout`, `profile`, `vertex_cache`, `screen`, `simplify`, `appearance`, `instances`, `scene`, `lod`, `override`, `budget`, `baseline`)");
    insta::assert_snapshot!(refused("[screen]\npixel = 2"), @"unknown key `screen.pixel` in `project/pipeline.toml` line 4 (did you mean `pixels`? known: `pixels`, `height`, `fov`)");
    insta::assert_snapshot!(refused("[[lod]]\nratio = 0.5\n[[lod]]\ntriangle = 5"), @"unknown key `lod[1].triangle` in `project/pipeline.toml` line 6 (did you mean `triangles`? known: `ratio`, `triangles`, `error`, `unit`, `pixels`, `size`, `appearance`, `scene_ratio`, `scene_triangles`, `scene_bytes`, `coverage`)");
    insta::assert_snapshot!(refused("normal = 0.1"), @r"
    unknown key `normal` in `project/pipeline.toml` line 3 (did you mean `format`? known: `input`, `output`, `include`, `exclude`, `ignore_files`, `follow_links`, `cache`, `jobs`, `format`, `storage`, `layout`, `profile`, `vertex_cache`, `screen`, `simplify`, `appearance`, `instances`, `scene`, `lod`, `override`, `budget`, `baseline`)
    hint: `normal` is a key of `[simplify]`
    ");
    insta::assert_snapshot!(refused("[simplify]\nseam = 1\njobs = 2"), @r"
    unknown key `simplify.jobs` in `project/pipeline.toml` line 5 (known: `metric`, `candidates`, `effort`, `normal`, `texcoord`, `color`, `border`, `seam`, `crease`, `placement`, `min_triangles`, `lock_border`)
    hint: `jobs` stands at the top of the file, before the first `[table]`
    ");
    insta::assert_snapshot!(refused("[[override]]\nmatch = 'a'\nsimplify.normals = 1"), @"unknown key `override[0].simplify.normals` in `project/pipeline.toml` line 5 (did you mean `normal`? known: `metric`, `candidates`, `effort`, `normal`, `texcoord`, `color`, `border`, `seam`, `crease`, `placement`, `min_triangles`, `lock_border`)");
}

#[test]
fn unknown_names_list_the_known() {
    insta::assert_snapshot!(refused("\n[simplify]\nmetric = 'qme'"), @"unknown simplify.metric `qme` in `project/pipeline.toml` line 5 (did you mean `qem`? known: `its`, `qem`, `qem-attributes`, `gaps`, `its-paper`, `ias`, `aps`, `tmpm`, `naive`, `auto`)");
    insta::assert_snapshot!(refused("profile = 'blender'"), @"unknown profile `blender` in `project/pipeline.toml` line 3 (known: `web`, `core`, `unity`, `unreal`, `godot`, `babylon-stream`)");
    insta::assert_snapshot!(refused("[[override]]\nmatch = 'a'\nstorage = 'Shared'"), @"unknown override[0].storage `Shared` in `project/pipeline.toml` line 5 (did you mean `shared`? known: `smallest`, `compact`, `shared`)");
}

#[test]
fn metrics_that_keep_to_source_vertices_refuse_to_move_them() {
    insta::assert_snapshot!(refused("[simplify]\nmetric = 'its-paper'\nplacement = 'optimal'"), @"`project/pipeline.toml` line 5: simplify.placement `optimal` is not for metric `its-paper`, which puts vertices onto one of the two ends");
    let settled = minimal("simplify.metric = 'its-paper'").unwrap().settings();
    assert_eq!(settled.simplify.placement, Placement::Subset);
    // Two layers that each are right: what the metric can do decides.
    let over = "simplify.placement = 'optimal'\n[[override]]\nmatch = '*'\nsimplify.metric = 'tmpm'";
    assert_eq!(minimal(over).unwrap().settings_for("a.glb").simplify.placement, Placement::Subset);
}

#[test]
fn ranges_are_stated() {
    insta::assert_snapshot!(refused("[[lod]]\nratio = 1.5"), @"`project/pipeline.toml` line 4: lod[0].ratio 1.5 is out of range: must be between 0 and 1, exclusive");
    insta::assert_snapshot!(refused("[[lod]]\nratio = 0"), @"`project/pipeline.toml` line 4: lod[0].ratio 0 is out of range: must be between 0 and 1, exclusive");
    insta::assert_snapshot!(refused("[[lod]]\nscene_ratio = 1"), @"`project/pipeline.toml` line 4: lod[0].scene_ratio 1 is out of range: must be between 0 and 1, exclusive");
    insta::assert_snapshot!(refused("[[lod]]\nscene_triangles = 0"), @"`project/pipeline.toml` line 4: lod[0].scene_triangles 0 is out of range: must be 1 or more");
    insta::assert_snapshot!(refused("[[lod]]\ntriangles = 0"), @"`project/pipeline.toml` line 4: lod[0].triangles 0 is out of range: must be 1 or more");
    insta::assert_snapshot!(refused("[[lod]]\ntriangles = 5_000_000_000"), @"`project/pipeline.toml` line 4: lod[0].triangles 5_000_000_000 is out of range: must be between 1 and 4294967295, both inclusive");
    insta::assert_snapshot!(refused("[[lod]]\nratio = 0.5\ncoverage = 1.01"), @"`project/pipeline.toml` line 5: lod[0].coverage 1.01 is out of range: must be more than 0 and at most 1");
    insta::assert_snapshot!(refused("[instances]\ncell = 0"), @"`project/pipeline.toml` line 4: instances.cell 0 is out of range: must be more than 0");
    insta::assert_snapshot!(refused("[instances]\ntolerance = 0"), @"`project/pipeline.toml` line 4: instances.tolerance 0 is out of range: must be more than 0 and at most 0.01");
    let words = "needs `recover` to be \"rigid\", \"similar\" or \"mirrored\"";
    for recover in ["", "recover = 'none'", "recover = 'exact'"] {
        let refused = refused(&format!("[instances]\nsplit = true\n{recover}"));
        assert_eq!(refused, format!("`project/pipeline.toml` line 4: instances.split {words}"));
    }
    let refused_over = refused("[[override]]\nmatch = '*'\ninstances = { split = true }");
    assert_eq!(refused_over, format!("`project/pipeline.toml` line 5: override[0].instances.split {words}"));
    insta::assert_snapshot!(refused("[simplify]\nnormal = -0.1"), @"`project/pipeline.toml` line 4: simplify.normal -0.1 is out of range: must be 0 or more");
    insta::assert_snapshot!(refused("[simplify]\nnormal = nan"), @"`project/pipeline.toml` line 4: simplify.normal nan is out of range: must be finite, and 0 or more");
    insta::assert_snapshot!(refused("[simplify]\nborder = inf"), @"`project/pipeline.toml` line 4: simplify.border inf is out of range: must be finite, and 0 or more");
    insta::assert_snapshot!(refused("[screen]\nfov = 180.0"), @"`project/pipeline.toml` line 4: screen.fov 180.0 is out of range: must be between 0 and 180, exclusive");
    insta::assert_snapshot!(refused("[screen]\nheight = 0.5"), @"`project/pipeline.toml` line 4: screen.height 0.5 is out of range: must be 1 or more");
    insta::assert_snapshot!(refused("jobs = -1"), @"`project/pipeline.toml` line 3: jobs -1 is out of range: must be between 0 and 4096, both inclusive");
    insta::assert_snapshot!(refused("lod = []"), @"`project/pipeline.toml` line 3: lod has 0 entries: must have between 1 and 32, both inclusive");
    insta::assert_snapshot!(refused("cache = ''"), @"`project/pipeline.toml` line 3: cache is empty");
}

#[test]
fn wrong_kinds_are_named() {
    insta::assert_snapshot!(refused("jobs = 'two'"), @"`project/pipeline.toml` line 3: jobs must be a whole number, not a string");
    insta::assert_snapshot!(refused("jobs = 2.5"), @"`project/pipeline.toml` line 3: jobs must be a whole number, not a number with a point");
    insta::assert_snapshot!(refused("screen = 5"), @"`project/pipeline.toml` line 3: screen must be a table, not a number");
    insta::assert_snapshot!(refused("include = 4"), @"`project/pipeline.toml` line 3: include must be a string or a list, not a number");
    insta::assert_snapshot!(refused("exclude = ['a', 5]"), @"`project/pipeline.toml` line 3: exclude[1] must be a string, not a number");
    insta::assert_snapshot!(refused("[simplify]\nmetric = 3"), @"`project/pipeline.toml` line 4: simplify.metric must be a string, not a number");
    insta::assert_snapshot!(refused("[[override]]\nmatch = 3"), @"`project/pipeline.toml` line 4: override[0].match must be a string or a list, not a number");
    insta::assert_snapshot!(refused("[lod]\nratio = 0.5"), @"`project/pipeline.toml` line 3: lod must be a list, not a table: write `[[lod]]`");
}

#[test]
fn absent_and_broken() {
    insta::assert_snapshot!(parse("output = 'out'").unwrap_err(), @"missing key `input` in `project/pipeline.toml` line 1");
    insta::assert_snapshot!(refused("[[override]]\nskip = true"), @"missing key `override[0].match` in `project/pipeline.toml` line 3");
    insta::assert_snapshot!(refused("jobs ="), @"`project/pipeline.toml` line 3: string values must be quoted, expected literal string");
    insta::assert_snapshot!(refused("jobs = 1\njobs = 2"), @"`project/pipeline.toml` line 4: duplicate key `jobs`");
    let missing = Pipeline::load(Path::new("no/such/pipeline.toml")).unwrap_err();
    assert!(missing.to_string().starts_with("failed to read `no/such/pipeline.toml`: "), "{missing}");
    insta::assert_snapshot!(missing.hint().unwrap(), @"`lodbake init` writes a commented `pipeline.toml`");
}

#[test]
fn rules_between_keys() {
    insta::assert_snapshot!(refused("[[lod]]\nratio = 0.5\nerror = 0.1"), @"`project/pipeline.toml` line 3: lod[0] must have exactly one of `ratio`, `triangles`, `error`, `pixels`, `appearance`, `scene_ratio`, `scene_triangles` and `scene_bytes`");
    insta::assert_snapshot!(refused("[[lod]]\ncoverage = 0.5"), @"`project/pipeline.toml` line 3: lod[0] must have exactly one of `ratio`, `triangles`, `error`, `pixels`, `appearance`, `scene_ratio`, `scene_triangles` and `scene_bytes`");
    insta::assert_snapshot!(refused("[[lod]]\nratio = 0.5\nunit = 'object'"), @"`project/pipeline.toml` line 5: lod[0].unit is the unit of `error`, which this level does not have");
    insta::assert_snapshot!(refused("[[lod]]\nratio = 0.5\n\n[[lod]]\nratio = 0.5"), @"`project/pipeline.toml` line 6: lod[1] has ratio 0.5 after 0.5: levels go from fine to coarse, ratio must become smaller");
    insta::assert_snapshot!(refused("lod = [{triangles = 9}, {error = 1}, {triangles = 10}]"), @"`project/pipeline.toml` line 3: lod[2] has triangles 10 after 9: levels go from fine to coarse, triangles must become smaller");
    insta::assert_snapshot!(refused("lod = [{error = 0.1}, {error = 0.01}]"), @"`project/pipeline.toml` line 3: lod[1] has error 0.01 after 0.1: levels go from fine to coarse, error must grow");
    insta::assert_snapshot!(refused("lod = [{scene_ratio = 0.5}, {ratio = 0.5}, {scene_ratio = 0.6}]"), @"`project/pipeline.toml` line 3: lod[2] has scene_ratio 0.6 after 0.5: levels go from fine to coarse, scene_ratio must become smaller");
    insta::assert_snapshot!(refused("lod = [{scene_triangles = 500}, {scene_triangles = 500}]"), @"`project/pipeline.toml` line 3: lod[1] has scene_triangles 500 after 500: levels go from fine to coarse, scene_triangles must become smaller");
    insta::assert_snapshot!(refused("lod = [{scene_bytes = 500}, {scene_bytes = 501}]"), @"`project/pipeline.toml` line 3: lod[1] has scene_bytes 501 after 500: levels go from fine to coarse, scene_bytes must become smaller");
    insta::assert_snapshot!(refused("scene.distances = [1, 0]"), @"`project/pipeline.toml` line 3: scene.distances[1] 0 is out of range: must be more than 0");
    insta::assert_snapshot!(refused("scene.cameras = [[1, 2]]"), @"`project/pipeline.toml` line 3: scene.cameras[0] has 2 entries: must have between 3 and 3, both inclusive");
    insta::assert_snapshot!(refused("lod = [{scene_ratio = 0.5, triangles = 5}]"), @"`project/pipeline.toml` line 3: lod[0] must have exactly one of `ratio`, `triangles`, `error`, `pixels`, `appearance`, `scene_ratio`, `scene_triangles` and `scene_bytes`");
    insta::assert_snapshot!(refused("lod = [{appearance = 2}, {appearance = 1}]"), @"`project/pipeline.toml` line 3: lod[1] has appearance 1 after 2: levels go from fine to coarse, the difference must grow");
    insta::assert_snapshot!(refused("lod = [{pixels = 1, size = 200}, {pixels = 1, size = 300}]"), @"`project/pipeline.toml` line 3: lod[1] has 1 pixels at 300 after 1 at 200: levels go from fine to coarse, pixels must grow or size must become smaller");
    insta::assert_snapshot!(refused("lod = [{pixels = 1}]"), @"`project/pipeline.toml` line 3: lod[0] needs `pixels` and `size` together: the error in pixels of a mesh that is `size` pixels high");
    insta::assert_snapshot!(refused("lod = [{ratio = 0.5, coverage = 0.5}, {ratio = 0.1}]"), @"`project/pipeline.toml` line 3: lod has `coverage` for 1 of 2 levels: give it for all or for none");
    insta::assert_snapshot!(refused("lod = [{ratio = 0.5, coverage = 0.5}, {ratio = 0.1, coverage = 0.6}]"), @"`project/pipeline.toml` line 3: lod[1] has coverage 0.6 after 0.5: levels go from fine to coarse, coverage must become smaller");
    insta::assert_snapshot!(refused("storage = 'shared'\nsimplify.placement = 'optimal'"), @"`project/pipeline.toml` line 4: simplify.placement `optimal` moves vertices, so the levels cannot use storage `shared`");
    insta::assert_snapshot!(refused("exclude = ['a', 'b[']"), @"`project/pipeline.toml` line 3: exclude[1] `b[` is not a glob: unclosed character class; missing ']'");
}

#[test]
fn folders_must_not_swallow_each_other() {
    let refused = |input: &str| parse(&format!("output = 'out'\ninput = {input}")).unwrap_err().to_string();
    insta::assert_snapshot!(refused("'./out'"), @"`project/pipeline.toml` line 2: input `./out` is also the output: scenes would be overwritten");
    insta::assert_snapshot!(refused("['a', 'out/sub/../sub']"), @"`project/pipeline.toml` line 2: input[1] `out/sub/../sub` lies in the output `out`, which is not scanned");
    insta::assert_snapshot!(refused("['a', 'b/../a']"), @"`project/pipeline.toml` line 2: input[1] `b/../a` is given twice");
    insta::assert_snapshot!(refused("[]"), @"`project/pipeline.toml` line 2: input is empty: name at least one folder");
    insta::assert_snapshot!(refused("''"), @"`project/pipeline.toml` line 2: input is empty");
    assert!(parse("output = 'out'\ninput = '.'").is_ok(), "an output inside the input is left out by the scan");
}

#[test]
fn units_of_errors_are_compared_apart() {
    let pipeline = minimal("lod = [{error = 0.1}, {error = 0.05, unit = 'object'}]").unwrap();
    let levels = pipeline.settings().chain.levels;
    assert_eq!(levels[0], LevelTarget::Error { limit: 0.1, unit: ErrorUnit::Radius });
    assert_eq!(levels[1], LevelTarget::Error { limit: 0.05, unit: ErrorUnit::Object });
}

#[test]
fn later_overrides_win_key_by_key() {
    let pipeline = minimal(
        "format = 'glb'
         [simplify]
         normal = 0.5
         seam = 0.5
         [[lod]]
         ratio = 0.5
         [[override]]
         match = ['props/**', 'street/*.glb']
         simplify.normal = 0.25
         simplify.metric = 'qem'
         storage = 'shared'
         lod = [{ triangles = 100, coverage = 0.2 }]
         [[override]]
         match = 'props/small/**'
         simplify.normal = 0.125
         screen.pixels = 2
         skip = true",
    )
    .unwrap();
    let plain = pipeline.settings_for("house.glb");
    let prop = pipeline.settings_for("props/a/lamp.glb");
    let small = pipeline.settings_for("props/small/cup.glb");
    assert_eq!(plain, pipeline.settings());
    assert_eq!([plain.skip, prop.skip, small.skip], [false, false, true]);
    assert_eq!([&plain, &prop, &small].map(|s| s.simplify.weights.normal), [0.5, 0.25, 0.125]);
    assert_eq!([&plain, &prop, &small].map(|s| s.simplify.weights.seam), [0.5; 3]);
    assert_eq!([&plain, &prop, &small].map(|s| s.simplify.metric), [Metric::Its, Metric::Qem, Metric::Qem]);
    assert_eq!([&plain, &prop, &small].map(|s| s.emit.screen.pixels), [1.0, 1.0, 2.0]);
    assert_eq!([&plain, &prop, &small].map(|s| s.emit.format), [Format::Glb; 3]);
    assert_eq!(plain.simplify.placement, Placement::Auto);
    assert_eq!(small.simplify.placement, Placement::Subset, "storage `shared` implies it");
    assert_eq!(plain.chain.levels, [LevelTarget::Ratio(0.5)]);
    assert_eq!(plain.emit.coverage, None);
    assert_eq!(small.chain.levels, [LevelTarget::Triangles(100)]);
    assert_eq!(small.emit.coverage, Some(vec![0.2]));
    assert_eq!(pipeline.settings_for("street/lamp.glb"), prop);
    assert_eq!(pipeline.settings_for("street/north/lamp.glb"), plain, "`*` stays within a folder");
}

#[test]
fn views_are_laid_key_by_key() {
    let pipeline = minimal(
        "scene = { cameras = [[1, 2, 3.5]], distances = [10, 20] }
         [[override]]
         match = 'inside/**'
         scene.distances = []",
    )
    .unwrap();
    let views = |path| pipeline.settings_for(path).scene;
    assert_eq!(views("a.glb"), ViewSettings { cameras: vec![[1.0, 2.0, 3.5]], distances: vec![10.0, 20.0] });
    assert_eq!(views("inside/a.glb"), ViewSettings { cameras: vec![[1.0, 2.0, 3.5]], distances: vec![] });
    assert_eq!(minimal("").unwrap().settings().scene, ViewSettings::default());
}

/// Every key that an override has also stands at the top, with the same schema: a new key cannot be forgotten there.
#[test]
fn overrides_have_the_keys_of_the_top() {
    let schema = schema();
    let over = schema["$defs"]["OverrideEntry"]["properties"].as_object().unwrap();
    for (key, entry) in over {
        if !["match", "skip"].contains(&key.as_str()) {
            let top = &schema["properties"][key];
            assert_eq!(top["$ref"], entry["$ref"], "{key}");
            assert_eq!(top["type"], entry["type"], "{key}");
        }
    }
}

#[test]
fn schema_is_valid_and_documents_every_key() {
    let schema = schema();
    assert!(jsonschema::meta::is_valid(&schema));
    let mut tables = vec![("", &schema)];
    tables.extend(schema["$defs"].as_object().unwrap().iter().map(|(name, table)| (name.as_str(), table)));
    for (name, table) in tables {
        for (key, property) in table.get("properties").and_then(|p| p.as_object()).into_iter().flatten() {
            assert!(property.get("description").is_some(), "{name}.{key} has no description");
            assert!(!property.to_string().contains("null"), "{name}.{key} allows null: {property}");
        }
    }
}

/// The defaults that the schema states are those that are applied.
#[test]
fn schema_states_the_defaults() {
    let schema = schema();
    let mut text = String::from("input = \"scenes\"\noutput = \"out\"\n");
    for (header, table) in [("", "/properties"), ("[screen]", "/$defs/ScreenTable/properties")]
        .into_iter()
        .chain([("[simplify]", "/$defs/SimplifyTable/properties")])
    {
        writeln!(text, "{header}").unwrap();
        for (key, property) in schema.pointer(table).unwrap().as_object().unwrap() {
            if let Some(default) = property.get("default") {
                writeln!(text, "{key} = {default}").unwrap();
            }
        }
    }
    let (spelled, short) = (parse(&text).unwrap(), minimal("").unwrap());
    assert_eq!(spelled.settings(), short.settings());
    assert_eq!(spelled.cache, short.cache);
    assert_eq!(spelled.include.patterns(), short.include.patterns());
    assert_eq!(
        (spelled.jobs, spelled.ignore_files, spelled.follow_links),
        (short.jobs, short.ignore_files, short.follow_links)
    );
    assert!(text.contains("fov") && text.contains("min_triangles") && text.contains("vertex_cache"), "{text}");
}

#[test]
fn budgets_have_their_rules() {
    let said = |rest: &str| refused(&format!("[[budget]]\n{rest}"));
    insta::assert_snapshot!(said("triangle = 5"), @"unknown key `budget[0].triangle` in `project/pipeline.toml` line 4 (did you mean `triangles`? known: `match`, `level`, `triangles`, `vertices`, `d_rms`, `surface`, `levels`, `min_levels`, `scene_triangles`, `distinct_triangles`, `scene_vertices`, `draw_calls`, `materials`, `texture_size`, `file_bytes`, `geometry_bytes`, `texture_bytes`, `undeclared`)");
    insta::assert_snapshot!(said("match = 'a/**'"), @"`project/pipeline.toml` line 3: budget[0] limits nothing: it needs one or more of `triangles`, `vertices`, `d_rms`, `surface`, `levels`, `min_levels`, `scene_triangles`, `distinct_triangles`, `scene_vertices`, `draw_calls`, `materials`, `texture_size`, `file_bytes`, `geometry_bytes`, `texture_bytes`, `undeclared`");
    insta::assert_snapshot!(said("triangles = { warn = 5, error = 4 }"), @"`project/pipeline.toml` line 4: budget[0].triangles has warn 5 beyond error 4: the warning would never come");
    insta::assert_snapshot!(said("triangles = 'many'"), @"`project/pipeline.toml` line 4: budget[0].triangles must be a number or a table, not a string");
    insta::assert_snapshot!(said("triangles = -1"), @"`project/pipeline.toml` line 4: budget[0].triangles -1 is out of range: must be 0 or more");
    insta::assert_snapshot!(said("triangles = {}"), @"`project/pipeline.toml` line 4: budget[0].triangles has no limit: give `warn`, `error`, `grow_percent` or `grow_by`");
    insta::assert_snapshot!(said("triangles = { eror = 1 }"), @"unknown key `budget[0].triangles.eror` in `project/pipeline.toml` line 4 (did you mean `error`? known: `warn`, `error`, `grow_percent`, `grow_by`)");
    insta::assert_snapshot!(said("min_levels = { grow_by = 1 }"), @"`project/pipeline.toml` line 4: budget[0].min_levels is a least number and cannot have a limit on growth");
    insta::assert_snapshot!(said("d_rms = { grow_percent = { warn = 9, error = 3 } }"), @"`project/pipeline.toml` line 4: budget[0].d_rms.grow_percent has warn 9 beyond error 3: the warning would never come");
    insta::assert_snapshot!(said("level = [33]\ntriangles = 1"), @"`project/pipeline.toml` line 4: budget[0].level[0] 33 is out of range: must be between 0 and 32, both inclusive");
    insta::assert_snapshot!(said("match = 'b['\ntriangles = 1"), @"`project/pipeline.toml` line 4: budget[0].match[0] `b[` is not a glob: unclosed character class; missing ']'");
}

#[test]
fn budgets_know_their_scenes_levels_and_lines() {
    let text = "[[budget]]\nmatch = 'props/**'\nlevel = [1, 2]\ntriangles = 900\nscene_triangles = { warn = 3.5 }\n\
                [[budget]]\nd_rms = { error = 8, grow_percent = 10, grow_by = { warn = 0.5, error = 1 } }\nscene_triangles = 7";
    let pipeline = minimal(text).unwrap();
    let [props, all] = &pipeline.budgets[..] else { panic!("two budgets") };
    assert!(props.matches("props/a.glb") && !props.matches("a.glb") && all.matches("a.glb"));
    let limit = props.limit(Fact::Triangles, Some(2)).unwrap();
    assert_eq!((limit.at, limit.line), (Bounds { warn: None, error: Some(900.0) }, 6));
    assert_eq!(props.limit(Fact::Triangles, Some(0)), None);
    assert_eq!(props.limit(Fact::SceneTriangles, Some(1)).map(|l| l.at.warn), Some(Some(3.5)));
    assert_eq!(all.limit(Fact::SceneTriangles, Some(1)), None);
    assert!(all.limit(Fact::SceneTriangles, Some(0)).is_some());
    let looks = all.limit(Fact::DRms, Some(3)).unwrap();
    assert_eq!(looks.grow_percent, Bounds { warn: None, error: Some(10.0) });
    assert_eq!(looks.grow_by, Bounds { warn: Some(0.5), error: Some(1.0) });
    assert_eq!(minimal("baseline = 'base.json'").unwrap().baseline.unwrap().path, Path::new("project/base.json"));
}
