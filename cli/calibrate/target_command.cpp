// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>

#include "calibrate/calibrate_commands.hpp"
#include "report.hpp"
#include "sightline/base/files.hpp"
#include "sightline/calibrate/target_file.hpp"
#include "sightline/calibrate/target_pdf.hpp"
#include "sightline/observe/fiducial/target_print.hpp"

namespace sightline::cli {
namespace {

struct TargetCommandOptions {
  std::filesystem::path out;
  std::string type = "charuco", paper = "A4", dictionary;
  int columns = 0, rows = 0, first_id = 0;
  double square_mm = 0, marker_mm = 0, gap_mm = 0;
  bool portrait = false;
};

Result<CalibrationTarget> describe(const TargetCommandOptions& o, const Paper& paper) {
  CalibrationTarget t;
  t.name = o.out.stem().string();
  const bool tags = o.type == "tag_grid";
  t.kind = tags                  ? TargetKind::kTagGrid
           : o.type == "charuco" ? TargetKind::kCharuco
                                 : TargetKind::kChessboard;
  const bool wide = paper.width > paper.height;
  t.columns = o.columns > 0 ? o.columns : tags ? (wide ? 6 : 4) : (wide ? 10 : 7);
  t.rows = o.rows > 0 ? o.rows : tags ? (wide ? 4 : 6) : (wide ? 7 : 10);
  t.dictionary = !o.dictionary.empty() ? o.dictionary : tags ? "tag36h11" : "5X5_100";
  if (t.kind == TargetKind::kChessboard) t.dictionary.clear();
  t.first_id = o.first_id;
  // Unit sizes first, so that what is not given follows from what fits the paper.
  const double square = 1e-3 * (tags ? o.marker_mm : o.square_mm);
  if (tags) {
    t.marker = square > 0 ? square : 1;
    t.gap = o.gap_mm > 0 ? 1e-3 * o.gap_mm : 0.3 * t.marker;
    if (square <= 0) {
      t.marker = largest_square(t, paper);
      t.gap = 0.3 * t.marker;
    }
  } else {
    t.square = square > 0 ? square : 1;
    if (square <= 0) t.square = largest_square(t, paper);
    if (t.kind == TargetKind::kCharuco) {
      t.marker = o.marker_mm > 0 ? 1e-3 * o.marker_mm : std::round(0.75e5 * t.square) / 1e5;
      t.layout = CharucoLayout::kDarkFirst;
    }
  }
  // What a target file may say is what may be printed.
  return parse_target(format_target(t), "target");
}

Status run(const TargetCommandOptions& o) {
  SL_ASSIGN(const Paper paper, find_paper(o.paper, !o.portrait));
  SL_ASSIGN(const CalibrationTarget target, describe(o, paper));
  SL_ASSIGN(const auto dark, target_print(target));
  SL_ASSIGN(const std::string pdf, target_pdf(target, dark, paper));
  const std::filesystem::path file = std::filesystem::path(o.out).replace_extension(".toml");
  SL_RETURN_IF_ERROR(write_file_atomically(o.out, pdf));
  SL_RETURN_IF_ERROR(write_file_atomically(file, format_target(target)));
  fmt::print("{}: {}\nwritten: {}, {}\n", target.name, target.describe(), o.out.string(),
             file.string());
  fmt::print(
      "Print at 100 %, check the ruler, glue it to something flat, measure a few squares, and "
      "correct {} if they differ.\n",
      file.string());
  return {};
}

}  // namespace

void add_calibrate_target(CLI::App& parent, Command& chosen) {
  auto options = std::make_shared<TargetCommandOptions>();
  auto* command = parent.add_subcommand("target", "a target to print (PDF), and its target file");
  command->add_option("--out", options->out, "PDF; the target file is written beside it")
      ->required();
  command->add_option("--type", options->type, "charuco (default), tag_grid or chessboard")
      ->check(CLI::IsMember({"charuco", "tag_grid", "chessboard"}));
  command->add_option("--paper", options->paper, "A4 (default), A3 or letter");
  command->add_flag("--portrait", options->portrait, "upright instead of landscape");
  command->add_option("--columns", options->columns, "squares, or tags")->check(CLI::Range(1, 100));
  command->add_option("--rows", options->rows, "squares, or tags")->check(CLI::Range(1, 100));
  command->add_option("--square-mm", options->square_mm, "side of a square (default: what fits)")
      ->check(CLI::PositiveNumber);
  command->add_option("--marker-mm", options->marker_mm, "side of a marker or tag")
      ->check(CLI::PositiveNumber);
  command->add_option("--gap-mm", options->gap_mm, "between tags (default: 0.3 of a tag)")
      ->check(CLI::PositiveNumber);
  command->add_option("--dictionary", options->dictionary,
                      "default 5X5_100; of a tag_grid the family, default tag36h11");
  command->add_option("--first-id", options->first_id, "of a tag_grid")
      ->check(CLI::NonNegativeNumber);
  command->callback([options, &chosen] {
    chosen = [options] {
      const Status done = run(*options);
      return done ? 0 : report(done.error());
    };
  });
}

}  // namespace sightline::cli
