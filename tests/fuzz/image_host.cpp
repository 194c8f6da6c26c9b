// SPDX-License-Identifier: Apache-2.0
// The image that a controller says it has, read by the host: named terms or a refusal. The first byte: bit 0 mends the CRC-32, bit 1
// the header but for the counts.
#include "files/calibration_file.hpp"
#include "flexcomp/image.hpp"
#include "flexcomp/signature.hpp"
#include "host_text.hpp"
#include "model/parameter_image.hpp"

namespace fuzz::image_host_target {
namespace {

using namespace flexcomp::host;

std::vector<std::uint8_t> image_of(const std::string& calibration) {
  return make_image(load_calibration(path_of(calibration), tx60l()), tx60l(), 1,
                    {.allow_unnamed = true, .allow_inadmissible = true});
}

void run(Input input) {
  const unsigned what = input.u8();
  Bytes image = input.rest();
  if ((what & 2U) != 0 && image.size() >= flexcomp::image::header_bytes) {
    static const std::vector<std::uint8_t> good = image_of(file_of("tests/data/tx60l_table1.yaml"));
    std::copy_n(good.begin(), 8, image.begin());
    flexcomp::store_u32(image.data() + 8, static_cast<std::uint32_t>(image.size()));
    std::copy_n(good.begin() + 16, 64, image.begin() + 16);
  }
  if ((what & 1U) != 0 && image.size() >= 4)
    flexcomp::store_u32(image.data() + image.size() - 4, flexcomp::crc32(image.data(), image.size() - 4));
  Calibration calibration;
  if (!reads([&] { calibration = calibration_from_image(image, tx60l(), "controller"); })) return;
  std::vector<std::uint8_t> plain;
  must_read("(an image)", [&] {
    const ImageRecords records = image_records(image, "controller");
    plain = without_signature(image, "controller");
    require(records.is_signed == (plain.size() != image.size()), "a signature that is not one");
  });
  Calibration same;
  must_read("(an image without its signature)",
            [&] { same = calibration_from_image(plain, tx60l(), "controller"); });
  require(!image_records(plain, "controller").is_signed &&
              same.terms.terms.size() == calibration.terms.terms.size(),
          "an image without its signature is another one");
  // It can be shown as a file, or is refused there.
  std::string text;
  if (!reads([&] { text = calibration_text(calibration, tx60l()); })) return;
  Calibration again;
  if (!reads([&] { again = load_calibration(path_of(text), tx60l()); })) return;
  require_same(text, calibration_text(again, tx60l()), "a calibration from an image");
}

std::vector<Bytes> seeds() {
  std::vector<Bytes> all;
  const std::string paper = file_of("tests/data/tx60l_table1.yaml");
  const auto add = [&all](const std::string& text) {
    try {
      const std::vector<std::uint8_t> image = image_of(text);
      all.push_back(Output().u8(3).add(image).out);
      Bytes signed_one(flexcomp::signed_size(image.size()));
      std::copy(image.begin(), image.end(), signed_one.begin());
      flexcomp::append_signature(signed_one.data(), image.size(), 7, {1, 2, 3});
      all.push_back(Output().u8(1).add(signed_one).out);
      if (all.size() < 3) all.push_back(Output().u8(0).add(image).out);
    } catch (const InputError&) {  // an effect of the measurement, which no image has
    }
  };
  add(paper);
  const std::string page = file_of("docs/effects.md");
  for (std::size_t at = page.find("- {effect:"); at != std::string::npos;
       at = page.find("- {effect:", at + 1))
    add("effects:\n  " + page.substr(at, page.find('\n', at) - at) + "\n");
  return all;
}

const Register registered({"image_host", run, seeds, nullptr});

}  // namespace
}  // namespace fuzz::image_host_target
