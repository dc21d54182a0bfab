#include "image/method.hpp"

#include <gmock/gmock.h>

#include "tests/unit/image/skies.hpp"

namespace srfs::image {
namespace {

using testing::HasSubstr;

constexpr std::array specs{ParameterSpec{"threshold", 5, 1, 10, ""}, ParameterSpec{"size", 3, 0, 100, ""}};

std::string refusal_of(const std::vector<std::string>& given) {
  const auto parameters = Parameters::parse(specs, given);
  return parameters ? "" : parameters.error().reason;
}

TEST(MethodParameters, AreTheStandardOnesUnlessGiven) {
  const auto parameters = Parameters::parse(specs, std::vector<std::string>{"size=7.5"});
  ASSERT_TRUE(parameters);
  EXPECT_EQ((*parameters)["threshold"], 5);
  EXPECT_EQ((*parameters)["size"], 7.5);
}

TEST(MethodParameters, AreRefusedWithTheReason) {
  EXPECT_THAT(refusal_of({"sise=7"}), HasSubstr("no parameter 'sise': there are threshold, size"));
  EXPECT_THAT(refusal_of({"size"}), HasSubstr("size=NUMBER"));
  EXPECT_THAT(refusal_of({"size=7x"}), HasSubstr("'7x' is not a number"));
  EXPECT_THAT(refusal_of({"size="}), HasSubstr("not a number"));
  EXPECT_THAT(refusal_of({"size=nan"}), HasSubstr("not a number"));
  EXPECT_THAT(refusal_of({"threshold=11"}), HasSubstr("not within 1 to 10"));
  EXPECT_THAT(refusal_of({"size=1", "size=2"}), HasSubstr("given twice"));
}

TEST(Methods, AreFoundByNameOrTheOnesThereAreAreNamed) {
  EXPECT_TRUE(find_method("star_centroid"));
  const auto unknown = find_method("stars");
  ASSERT_FALSE(unknown);
  EXPECT_THAT(unknown.error().reason,
              HasSubstr("no method 'stars': there are star_centroid, streak, tracklet"));
}

TEST(Methods, AllTakeTheirStandardParametersAndAnEmptyFrame) {
  for (const MethodEntry& entry : methods()) {
    const auto parameters = Parameters::parse(entry.parameters, {});
    ASSERT_TRUE(parameters);
    Frame frame;
    frame.pixels = Plane(40, 30, 0.0F);
    const auto method = entry.make(*parameters);
    const auto found = method->process(frame);
    ASSERT_TRUE(found) << entry.name;
    EXPECT_TRUE(found->stars.empty());
    EXPECT_TRUE(found->streaks.empty());
    EXPECT_TRUE(method->finish().tracklets.empty());
  }
}

TEST(FrameSize, IsRefusedBelowOneAndAboveAHundredMegapixels) {
  EXPECT_FALSE(refuse_size(1, 1));
  EXPECT_FALSE(refuse_size(10000, 10000));
  EXPECT_THAT(refuse_size(10000, 10001).value().reason, HasSubstr("more than 100 million"));
  EXPECT_THAT(refuse_size(1LL << 62, 1LL << 62).value().reason, HasSubstr("more than"));
  EXPECT_THAT(refuse_size(0, 5).value().reason, HasSubstr("no image"));
}

}  // namespace
}  // namespace srfs::image
