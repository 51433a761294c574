//! Pages in a browser: headless Chromium, if it is installed.

use super::fixture::{Fixture, has};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use serde_json::Value;
use std::process::Command;

/// The value of a script that runs beside a page in a window of that width: `own` is the window.
fn inspect(folder: &Fixture, page: &str, (width, is_dark): (u32, bool), script: &str) -> Value {
    let errors = "<script>var errors = [];\
                  addEventListener('error', (e) => errors.push(e.message));\
                  console.error = (...words) => errors.push(words.join(' '));</script>";
    let text = folder
        .text(page)
        .replacen("<head>", &format!("<head>{errors}"), 1);
    folder.write("inspected.html", text);
    let helpers = include_str!("browser.js");
    let harness = format!(
        "<!DOCTYPE html><pre id=out></pre><iframe id=own width={width} height=900 \
         style='border:0'></iframe><script>{helpers}
         const view = document.getElementById('own');
         view.onload = () => {{
           const own = view.contentWindow;
           let value;
           try {{ value = (() => {{ {script} }})(); }} catch (e) {{ value = String(e); }}
           const found = JSON.stringify({{ value, errors: own.errors }});
           const out = btoa(unescape(encodeURIComponent(found)));
           document.getElementById('out').textContent = 'OUT' + out + 'END';
         }};
         view.src = 'inspected.html';</script>"
    );
    let harness = folder.write("harness.html", harness);
    let profile = folder.path("browser");
    let scheme = if is_dark { 0 } else { 1 };
    let ran = Command::new("chromium")
        .args([
            "--headless=new",
            "--no-sandbox",
            "--disable-gpu",
            "--hide-scrollbars",
        ])
        .args(["--disable-web-security", "--allow-file-access-from-files"])
        .arg(format!("--blink-settings=preferredColorScheme={scheme}"))
        .arg(format!("--user-data-dir={}", profile.display()))
        .args([
            "--window-size=1600,1200",
            "--virtual-time-budget=8000",
            "--dump-dom",
        ])
        .arg(format!("file://{}", harness.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&ran.stdout);
    let out = dom
        .split("OUT")
        .nth(1)
        .and_then(|out| out.split("END").next());
    let out = out.unwrap_or_else(|| panic!("{}", String::from_utf8_lossy(&ran.stderr)));
    let bytes = STANDARD.decode(out).unwrap();
    let found: Value = serde_json::from_slice(&bytes).unwrap();
    assert_eq!(found["errors"], serde_json::json!([]), "{page}");
    found["value"].clone()
}

/// The links to the worst frames, and the titles of the bars, have the numbers of the rows.
#[test]
fn the_worst_frames_and_the_bars_are_those_of_the_rows() {
    let run = Fixture::new();
    run.record_short_arena("run.mcap", 40, 7);
    run.run("score run.mcap --algo bm --algo v3 --rerun none -o r");
    let page = run.text("r/index.html");
    let column = |name: &str| run.column("r/rows.csv", name);
    let (labels, missed, wrong) = (column("algorithm"), column("missed"), column("cells_wrong"));
    for label in ["bm", "v3"] {
        let own = |cells: &[String]| -> Vec<u64> {
            let own = labels.iter().zip(cells).filter(|(own, _)| *own == label);
            own.map(|(_, cells)| cells.parse::<f64>().unwrap() as u64)
                .collect()
        };
        let (missed, wrong) = (own(&missed), own(&wrong));
        let (most_missed, most_wrong) = missed.iter().zip(&wrong).max().unwrap();
        let count = |cells: u64, word: &str| (cells > 0).then(|| format!("{cells} {word}"));
        let words = [count(*most_missed, "missed"), count(*most_wrong, "wrong")];
        let words = words.into_iter().flatten().collect::<Vec<_>>().join(", ");
        let lane = page
            .split("lane-name")
            .find(|lane| lane.contains(&format!("<b>{label}</b>")));
        let lane = lane.unwrap();
        let first = lane.split("</a>").next().unwrap();
        assert!(first.ends_with(&format!("s: {words}")), "{words}: {first}");
        let title = format!("title=\"{label}, ");
        let bars = lane.split(&title).skip(1).map(|bar| {
            let number = |word: &str| -> u64 {
                let before = bar.split(word).next().unwrap().trim_end();
                before.rsplit([' ', ':']).next().unwrap().parse().unwrap()
            };
            [number(" wrong"), number(" missed")]
        });
        let sums = bars.fold([0, 0], |sum, bar| [sum[0] + bar[0], sum[1] + bar[1]]);
        assert_eq!(
            sums,
            [wrong.iter().sum(), missed.iter().sum::<u64>()],
            "{label}"
        );
    }
}

#[test]
fn several_recordings_have_a_table_in_page_markdown_and_json() {
    let run = Fixture::new();
    run.record_short_arena("a.mcap", 12, 7);
    run.record_short_arena("b.mcap", 12, 304);
    run.transcript(
        "score a.mcap b.mcap -q --algo bm --algo v3 --rerun none -o r
        cat r/index.html => Recordings: | a bar per recording
        cat r/summary.md => ## Recordings: 
        cat r/summary.json => /recordings/# = 4 | /recordings/0/pairs > 0 \
         | /recordings/0/right > 0
        score a.mcap -q --algo v3 --rerun none -o one
        cat one/index.html => !Recordings: | a bar per second
        cat one/summary.json => /recordings absent",
    );
}

/// `svl view` prints the second of the best algorithm with the most missed, then wrong cells.
#[test]
fn the_worst_second_is_that_of_the_rows() {
    let run = Fixture::new();
    run.record_short_arena("a.mcap", 20, 7);
    run.record_short_arena("b.mcap", 40, 304);
    run.run("score a.mcap b.mcap --from 0.5 --algo v1 -o r");
    let column = |name: &str| run.column("r/rows.csv", name);
    let columns = ["run", "stamp_ns", "missed", "cells_wrong"].map(column);
    let number = |column: usize, i: usize| columns[column][i].parse::<f64>().unwrap();
    let mut seconds = std::collections::BTreeMap::new();
    for (i, name) in columns[0].iter().enumerate() {
        let sums: &mut [f64; 2] = seconds
            .entry((name, number(1, i) as u64 / 1_000_000_000))
            .or_default();
        *sums = [sums[0] + number(2, i), sums[1] + number(3, i)];
    }
    let worst = seconds.iter().reduce(|a, b| if b.1 > a.1 { b } else { a });
    let ((name, second), [missed, wrong]) = worst.unwrap();
    let shown = run.svl_with("view r", &[("PATH", "")]);
    let line = shown.stdout.lines().next().unwrap();
    let begins = format!("worst second: {name} at {second}.");
    let ends = format!(" s (v1: {missed} cells missed, {wrong} wrong)");
    assert!(
        line.starts_with(&begins) && line.ends_with(&ends),
        "{line}: {begins}{ends}"
    );
    assert!(*missed > 0.0, "{line}");
}

/// A bar without a stored frame has numbers and a command; a frame has one, too, and the command
/// replays that pair.
#[test]
fn bars_and_frames_have_commands_that_replay_them() {
    let run = Fixture::new();
    run.record_short_arena("my run.mcap", 40, 7);
    run.run(
        "score 'my run.mcap' --from 1 --algo bm --algo now=v3:max_disparity=48 --rerun none -o r",
    );
    let page = run.text("r/index.html");
    let commands = |attribute: &str| -> Vec<String> {
        let start = format!("{attribute}=\"");
        let all = page.split(&start).skip(1);
        let all = all.map(|own| own.split('"').next().unwrap().to_owned());
        let all = all.map(|own| own.replace("&#x27;", "'").replace("&#x2f;", "/"));
        all.collect()
    };
    let bars = commands("data-command");
    assert!(
        bars[0].contains("my run.mcap' --from 1 --to 2 --rerun spawn --algo "),
        "{bars:?}"
    );
    let now = "--algo now=v3:max_disparity=48";
    assert!(bars.iter().any(|own| own.ends_with(now)), "{bars:?}");
    let frames = commands("data-replay");
    let algorithms = commands("data-algo");
    assert!(algorithms.iter().any(|own| own == now), "{algorithms:?}");
    for (command, pairs) in [(&bars[0], 10), (&format!("{} {now}", frames[0]), 1)] {
        let command = command.strip_prefix("svl ").unwrap();
        let command = command.replace("--rerun spawn", "--rows rows.csv");
        run.run(&command);
        assert_eq!(run.column("rows.csv", "sequence").len(), pairs, "{command}");
        std::fs::remove_file(run.path("rows.csv")).unwrap();
    }
}

#[test]
fn frames_are_filtered_by_run_and_checkpoint() {
    if !has("chromium", &["--version"]) {
        return crate::common::skip("no Chromium: pages in a browser");
    }
    let run = Fixture::new();
    run.record_short_arena("a.mcap", 20, 7);
    run.record_short_arena("b.mcap", 20, 304);
    let checkpoint = |number: u32, file: &str, frames: [u32; 2]| {
        format!(
            "[[checkpoint]]\nnumber = {number}\nname = \"c{number}\"\ndescription = \"\"\n\
             file = \"{file}\"\nframes = {frames:?}\n[[checkpoint.cell]]\nat = [2, 1]\n\
             free = true\n"
        )
    };
    let scenario = format!(
        "name = \"two\"\nalgorithms = [\"bm\", \"v3\"]\n[source]\nkind = \"recording\"\n\
         files = [\"a.mcap\", \"b.mcap\"]\n{}{}",
        checkpoint(1, "a.mcap", [0, 9]),
        checkpoint(2, "b.mcap", [10, 19])
    );
    run.write("two.toml", scenario);
    run.run("score two.toml --rerun none -o r");
    let found = inspect(
        &run,
        "r/index.html",
        (1400, false),
        "
        const left = () => [...own.document.querySelectorAll('[data-choose]:not([hidden])')].map(
          (button) => own.document.getElementById(button.dataset.choose));
        const choose = (name, value) => {
          const select = own.document.querySelector(`[data-select=${name}]`);
          select.value = value;
          select.dispatchEvent(new own.Event('change', { bubbles: true }));
        };
        const all = left().length;
        choose('checkpoint', '2');
        const second = left().every((figure) =>
          figure.id === 'cp2' || /^b.mcap.1[0-9]$/.test(figure.dataset.frame));
        const some = left().length;
        choose('run', 'b.mcap');
        const both = left().length;
        choose('checkpoint', '');
        const more = left().length;
        const seen = [...own.document.querySelectorAll('.figure.on .shot:not(.off)')];
        const ofRun = seen.length > 0 && seen.every((shot) => shot.dataset.run === 'b.mcap');
        const first = own.document.querySelector('.figure[data-frame^=\"a.mcap/\"]');
        own.location.hash = '#' + first.dataset.frame;
        own.dispatchEvent(new own.HashChangeEvent('hashchange'));
        return { fewer: all > more && more > both && both === some && some > 1, second, ofRun,
          opened: on(own) === first.id && left().length === all };
        ",
    );
    let all_hold = serde_json::json!({
        "fewer": true, "second": true, "ofRun": true, "opened": true
    });
    assert_eq!(found, all_hold);
}

#[test]
fn a_report_shows_where_it_failed_and_obeys_keys_and_links() {
    if !has("chromium", &["--version"]) {
        return crate::common::skip("no Chromium: pages in a browser");
    }
    let run = Fixture::new();
    run.record_short_arena("run.mcap", 40, 7);
    run.run("score run.mcap --algo bm --algo v1 --algo v3 --rerun none -o r");
    let page = "r/index.html";
    for (width, is_dark) in [(1400, false), (900, true), (420, false)] {
        let faults = inspect(&run, page, (width, is_dark), "return faults(own);");
        assert_eq!(faults, serde_json::json!([]), "{width} px");
    }
    let found = inspect(
        &run,
        page,
        (1400, false),
        "
        const at = (selector) => own.document.querySelectorAll(selector).length;
        const worst = at('.lane-name a'), bars = at('.bin');
        const linked = at('a.bin:not([href=\"#bin\"])');
        const first = on(own);
        const shell = (id) => {
          const line = own.document.getElementById(id);
          return line.hidden ? '' : line.textContent.trim().replace(/\\s+/g, ' ');
        };
        const command = shell('frame-command'), before = shell('bin');
        // The bar is as one without a stored frame.
        const bare = own.document.querySelector('a.bin');
        bare.setAttribute('href', '#bin');
        bare.click();
        const told = before === '' && shell('bin').startsWith(bare.title)
          && shell('bin').includes(bare.dataset.command) && on(own) === first;
        key(own, 'keydown', 'ArrowRight');
        const second = on(own), address = own.location.hash;
        key(own, 'keydown', 'ArrowLeft');
        const back = on(own);
        key(own, 'keydown', 't');
        const blinking = at('.blink');
        key(own, 'keyup', 't');
        const after = at('.blink');
        const wrongOnly = own.document.querySelector('[data-filter=wrong]');
        wrongOnly.click();
        const left = at('[data-choose]:not([hidden])');
        const wrong = at('.figure:has(.shot[data-is~=wrong])');
        wrongOnly.click();
        own.document.querySelector('.lane-name a').click();
        const opened = own.location.hash.slice(1), shown = on(own);
        own.document.querySelector('.figure.on .shot:not(.off) svg').dispatchEvent(
          new own.MouseEvent('click', { bubbles: true }));
        const large = at('dialog[open] svg');
        const frame = own.document.querySelector('.figure[data-frame]');
        own.location.hash = '#' + encodeURI(frame.dataset.frame) + '/v3';
        own.dispatchEvent(new own.HashChangeEvent('hashchange'));
        const linkedTo = on(own) === frame.id;
        const slider = own.document.getElementById('slider');
        slider.value = slider.max;
        slider.dispatchEvent(new own.Event('input'));
        const last = on(own);
        return { worst, bars, linked, moved: first !== second, address, back: back === first,
          blinking, after, filtered: left === wrong && wrong > 0, opened: opened === shown,
          large, linkedTo, told, command,
          slid: last !== frame.id };
        ",
    );
    let is = |name: &str| assert!(found[name] == true, "{name}: {found}");
    [
        "moved", "back", "filtered", "opened", "linkedTo", "slid", "told",
    ]
    .iter()
    .for_each(|name| is(name));
    let command = found["command"].as_str().unwrap();
    let ends = ["--rerun spawn --algo", "copy"];
    assert!(command.starts_with("svl replay "), "{found}");
    assert!(ends.iter().all(|own| command.contains(own)), "{found}");
    assert!(found["worst"].as_u64() > Some(3), "{found}");
    assert!(
        found["bars"].as_u64() >= found["linked"].as_u64(),
        "{found}"
    );
    assert!(found["linked"].as_u64() > Some(0), "{found}");
    assert!(
        found["address"].as_str().unwrap().starts_with("#run.mcap/"),
        "{found}"
    );
    assert!(found["blinking"].as_u64() > Some(0), "{found}");
    assert_eq!(found["after"], 0, "{found}");
    assert_eq!(found["large"], 1, "{found}");
}

#[test]
fn tables_sort_and_the_page_links_to_its_parts_and_files() {
    if !has("chromium", &["--version"]) {
        return crate::common::skip("no Chromium: pages in a browser");
    }
    let run = Fixture::new();
    run.record_short_arena("run.mcap", 12, 7);
    let stress = "--stress noise=2/5/10/20";
    run.run(&format!(
        "score run.mcap --algo bm --algo v3 --algo blind {stress} --rerun none -o r"
    ));
    let page = "r/index.html";
    let found = inspect(
        &run,
        page,
        (1400, false),
        "
        const { document: page } = own, list = (what) => [...page.querySelectorAll(what)];
        const cut = list('#stress .scroll').filter((own) => own.scrollWidth > own.clientWidth + 1);
        const first = (what) => page.querySelector(`#stress ${what}`);
        const order = first('table').compareDocumentPosition(first('.plots'));
        const heads = list('thead th[scope=col]:not(:has(button, .cp))').length;
        const table = page.querySelector('#speed table');
        const column = [...table.rows[1].cells].findIndex((own) => own.textContent === 'p50');
        const button = table.rows[1].cells[column].querySelector('button');
        const texts = (i) => [...table.tBodies[0].rows].map((row) => row.cells[i].textContent);
        button.click();
        const down = texts(column).map(Number);
        button.click();
        const up = texts(column).map(Number);
        table.rows[1].cells[0].querySelector('button').click();
        const links = list('.contents a');
        const broken = links.filter((a) => !page.querySelector(a.hash));
        return { cut: cut.length, order, heads, down, up, names: texts(0), focus: button.tabIndex,
          hidden: page.querySelector('.contents').hidden, broken: broken.length,
          links: links.map((a) => a.textContent),
          files: list('.files a').map((a) => a.getAttribute('href')) };
        ",
    );
    let numbers = |name: &str| -> Vec<f64> { serde_json::from_value(found[name].clone()).unwrap() };
    let (down, mut up) = (numbers("down"), numbers("up"));
    assert!(
        down.is_sorted_by(|a, b| a >= b) && down.len() == 3,
        "{found}"
    );
    up.reverse();
    assert_eq!(down, up, "{found}");
    assert_eq!(found["names"], serde_json::json!(["blind", "bm", "v3"]));
    // DOCUMENT_POSITION_FOLLOWING
    assert_eq!(found["order"], 4, "{found}");
    for name in ["cut", "heads", "focus", "broken"] {
        assert_eq!(found[name], 0, "{name}: {found}");
    }
    assert_eq!(found["hidden"], false, "{found}");
    let links = found["links"].as_array().unwrap();
    assert!(links.contains(&"Against stress".into()) && links.contains(&"Speed".into()));
    let files = found["files"].as_array().unwrap();
    for file in files {
        assert!(
            run.path(&format!("r/{}", file.as_str().unwrap())).exists(),
            "{file}"
        );
    }
    assert!(files.contains(&"rows.csv".into()) && files.contains(&"summary.json".into()));
}

#[test]
fn the_page_of_a_sweep_opens_two_algorithms() {
    if !has("chromium", &["--version"]) {
        return crate::common::skip("no Chromium: pages in a browser");
    }
    let run = Fixture::new();
    run.record_short_arena("run.mcap", 8, 7);
    run.run("score run.mcap --algo bm:uniqueness=5..30/5 --rerun none -o r");
    for (width, is_dark) in [(1400, true), (420, false)] {
        let found = inspect(
            &run,
            "r/index.html",
            (width, is_dark),
            "
            const list = (what) => [...own.document.querySelectorAll(what)];
            const seen = (what) => list(what).filter((one) => one.checkVisibility()).length;
            return { lanes: seen('.lane'), all: list('.lane').length, shots: seen('.shot'),
              faults: faults(own) };
            ",
        );
        let expected = serde_json::json!({ "lanes": 2, "all": 6, "shots": 2, "faults": [] });
        assert_eq!(found, expected, "{width} px");
    }
}

#[test]
fn a_layer_of_drives_is_its_ways_and_its_rows() {
    if !has("chromium", &["--version"]) {
        return crate::common::skip("no Chromium: pages in a browser");
    }
    let found = inspect(
        &super::drive::driven(),
        "r/index.html",
        (1400, false),
        "
        const list = (what) => [...own.document.querySelectorAll(what)];
        const isShown = (one) => !one.hidden && one.style.display !== 'none';
        const seen = () => [list('#courses tbody tr'), list('[data-layer=blind]')].map(
          (own) => own.filter(isShown).length);
        const before = seen();
        list('[data-show=blind]')[0].click();
        const color = own.getComputedStyle(list('#courses .good')[0]).color;
        const plain = own.getComputedStyle(own.document.body).color;
        return { before, after: seen(), colored: color !== plain };
        ",
    );
    let expected = serde_json::json!({ "before": [4, 2], "after": [2, 0], "colored": true });
    assert_eq!(found, expected);
}

/// The questions of a reader, and per page the selectors of what answers them, with a part of the
/// answer: what is it worth or what changed, where did it fail, by how much, which second.
const ANSWERS: [(&str, [(&str, &str); 4]); 4] = [
    (
        "a/index.html",
        [
            (".answer", "40 pairs"),
            (".lane-name a", " s: "),
            (".lane-name a", " wrong"),
            ("a.bin", "bm, 3 s: "),
        ],
    ),
    (
        "camera/index.html",
        [
            (".answer", "40 pairs"),
            ("#accuracy tbody td", "all"),
            ("#accuracy thead th:nth-child(7)", "RMSE m"),
            (".lane-name a", " s: "),
        ],
    ),
    (
        "page.html",
        [
            (".answer", "40 pairs"),
            (".shot .note", "changed: "),
            (".changes td:nth-child(4)", " points"),
            (".figure h3", " s"),
        ],
    ),
    (
        "trend.html",
        [
            ("h1", "the newest last"),
            ("section tbody th", "2 b"),
            ("figure .title", "right cells"),
            ("section tbody td", "20"),
        ],
    ),
];

#[test]
fn every_page_answers_its_questions() {
    if !has("chromium", &["--version"]) {
        return crate::common::skip("no Chromium: pages in a browser");
    }
    let run = Fixture::new();
    run.record_short_arena("run.mcap", 40, 7);
    run.transcript(
        "replay run.mcap --algo sgm -q -o result.mcap
        score result.mcap --algo camera=topic:/algo/sgm/disparity --rerun none -q -o camera
        score run.mcap --algo bm --rerun none -q -o a
        score run.mcap --algo bm:block_size=21 --rerun none -q -o b
        compare a b -o page.html
        compare a b a -o trend.html",
    );
    for (page, answers) in ANSWERS {
        let found = inspect(
            &run,
            page,
            (1400, false),
            &format!(
                "return {}.map(([selector]) => [...own.document.querySelectorAll(selector)].map(
                  (one) => one.textContent + (one.title || '')).join('|'));",
                serde_json::json!(answers)
            ),
        );
        for ((selector, words), text) in answers.iter().zip(found.as_array().unwrap()) {
            let text = text.as_str().unwrap();
            assert!(text.contains(words), "{page} {selector}: {text}");
        }
    }
}

#[test]
fn a_comparison_filters_its_frames_by_their_changes() {
    if !has("chromium", &["--version"]) {
        return crate::common::skip("no Chromium: pages in a browser");
    }
    let run = Fixture::new();
    run.record_short_arena("run.mcap", 40, 7);
    let long = "l".repeat(200);
    run.transcript(&format!(
        "score run.mcap --algo v3 --algo bm --rerun none -q -o a
        score run.mcap --algo v3:max_disparity=8 --algo bm:block_size=21 --rerun none -q -o {long}
        compare a {long} -o page.html
        compare a {long} a -o trend.html"
    ));
    for page in ["page.html", "trend.html"] {
        for view in [(1400, false), (1400, true), (900, true), (420, false)] {
            let faults = inspect(&run, page, view, "return faults(own);");
            assert_eq!(faults, serde_json::json!([]), "{page} {view:?}");
        }
    }
    let found = inspect(
        &run,
        "page.html",
        (1400, false),
        "
        const at = (selector) => own.document.querySelectorAll(selector).length;
        const left = () => at('[data-choose]:not([hidden])');
        const all = left(), kinds = {};
        const buttons = [...own.document.querySelectorAll('.chooser [data-filter]')];
        for (const button of buttons) {
          button.click();
          const { filter } = button.dataset;
          const isRight = at(`.figure.on .shot:not(.off):not([data-is~=${filter}])`) === 0;
          const pressed = button.getAttribute('aria-pressed');
          kinds[filter] = [left(), pressed, isRight || filter === 'wrong'];
          button.click();
        }
        const unfiltered = left() === all;
        const number = own.document.querySelector('.algorithm:nth-of-type(3) [data-filter=worse]');
        number.focus();
        const focused = own.document.activeElement === number;
        number.click();
        const shown = new Set([...own.document.querySelectorAll('.figure.on .shot:not(.off)')]
          .map((shot) => shot.dataset.algorithm));
        const isOther = shown.size === 1 && shown.has(number.dataset.algorithm);
        const pressed = number.getAttribute('aria-pressed');
        number.click();
        const first = on(own);
        key(own, 'keydown', 'ArrowRight');
        const moved = on(own) !== first, address = decodeURI(own.location.hash);
        key(own, 'keydown', 't');
        const blinking = at('.blink');
        key(own, 'keyup', 't');
        const frame = own.document.querySelector('.figure[data-frame]');
        own.location.hash = '#' + encodeURI(frame.dataset.frame);
        own.dispatchEvent(new own.HashChangeEvent('hashchange'));
        const linked = on(own) === frame.id;
        return { all, kinds, unfiltered, focused, isOther, pressed, moved, address, blinking,
          linked, pictures: at('.figure [data-kind=disparity]'),
          errors: at('.figure [data-kind=error]') };
        ",
    );
    for name in ["unfiltered", "focused", "isOther", "moved", "linked"] {
        assert!(found[name] == true, "{name}: {found}");
    }
    let kinds = &found["kinds"];
    let number = |kind: &str| kinds[kind][0].as_u64().unwrap();
    for kind in ["worse", "equal", "better", "wrong"] {
        assert!(number(kind) <= found["all"].as_u64().unwrap(), "{found}");
        assert_eq!(
            (&kinds[kind][1], &kinds[kind][2]),
            (&"true".into(), &true.into()),
            "{kind}"
        );
    }
    assert!(
        number("worse") > 0 && number("worse") < found["all"].as_u64().unwrap(),
        "{found}"
    );
    assert_eq!(found["pressed"], "true");
    assert!(
        found["address"]
            .as_str()
            .unwrap()
            .ends_with("/bm → bm:block_size=21"),
        "{found}"
    );
    for name in ["blinking", "pictures", "errors"] {
        assert!(found[name].as_u64() > Some(0), "{name}: {found}");
    }
}
