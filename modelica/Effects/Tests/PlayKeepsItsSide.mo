within Effects.Tests;
model PlayKeepsItsSide "Play after a rise, while the value holds, and after a fall"
  Real u = 3.0*(tanh(4.0*(time - 2.0)) - tanh(4.0*(time - 8.0))) "Up to 6, held, and back to 0";
  Signals.Backlash gear(u=u, play=0.2);
  Signals.Hysteresis caliper(u=u, share=0.05, play=0.2);
equation
  // 2 s after a step the linkage has followed it: exp(-2/0.1) is 2e-9.
  assert(time < 4.5 or time > 6.0 or abs(gear.y - (u - 0.2)) < 1e-3, "Not behind after a rise");
  assert(time < 10.5 or abs(gear.y - (u + 0.2)) < 1e-3, "Not ahead after a fall");
  assert(time < 4.5 or time > 6.0 or abs(caliper.y - 0.95*u) < 1e-3, "No loss after a rise");
  assert(time < 7.9 or time > 8.1 or caliper.y > 0.95*u, "No change of side in the fall");
  annotation (experiment(StopTime=12.0, Tolerance=1e-8));
end PlayKeepsItsSide;
