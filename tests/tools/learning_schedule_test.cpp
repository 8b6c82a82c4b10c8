// When records are fitted to the samples of the picture.

#include <catch2/catch.hpp>

#include "runtime/tools/learning_schedule.h"

using namespace lobe;

TEST_CASE("loberender: records are fitted to the picture's samples at doubled numbers of samples") {
  LearningSchedule schedule(120);
  CHECK_FALSE(schedule.isDue({9, 30}));
  CHECK(schedule.isDue({11, 40}));
  schedule.fitted({11, 40}, 0.1);
  CHECK_FALSE(schedule.isDue({20, 75}));
  CHECK(schedule.isDue({22, 80}));
  schedule.fitted({22, 80}, 0.1);
  CHECK_FALSE(schedule.isOver({30, 110}));
  CHECK(schedule.isDue({45, 170}));
  schedule.fitted({45, 170}, 0.1);
  CHECK(schedule.isOver({46, 172}));
  CHECK_FALSE(schedule.isDue({90, 400}));
}

TEST_CASE("loberender: a fit that takes long is not repeated before it is a small part of the time") {
  LearningSchedule schedule(120);
  CHECK(schedule.isDue({11, 40}));
  schedule.fitted({11, 40}, 1);
  CHECK_FALSE(schedule.isDue({22, 80}));
  CHECK(schedule.isDue({26, 95}));
  CHECK_FALSE(schedule.isDue({67, 250}));
  CHECK(schedule.isOver({67, 250}));
}
