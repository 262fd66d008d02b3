within CascadedTanks.Tests;
model SensorIsBentAtBothEnds "A bent characteristic is right in the middle and wrong alike at the ends"
  Effects.SensorCurvature empty(u=0.0, bow=0.5);
  Effects.SensorCurvature half(u=5.0, bow=0.5);
  Effects.SensorCurvature full(u=10.0, bow=0.5);
  Effects.PumpGainChange pump(u=4.0, curvature=0.05);
equation
  assert(abs(empty.y - 0.5) + abs(half.y - 5.0) + abs(full.y - 10.5) <= 0.0, "Not bent as said");
  assert(abs(pump.y - 4.8) < 1e-12, "The gain does not change with the voltage");
  annotation (experiment(StopTime=1.0, Tolerance=1e-6));
end SensorIsBentAtBothEnds;
