within Effects.Tests;
model SignalsAreShiftedScaledAndClipped "Laws without states at points that define them"
  Real u = 4.0*time - 2.0 "From -2 to 2";
  Signals.Offset offset(u=u, offset=0.3);
  Signals.Gain gain(u=u, gain=-0.1);
  Signals.Saturation clipped(u=u, share=1.0, high=1.0);
  Signals.Saturation oneSided(u=u, share=0.5, high=1.0, low=-1e6);
  Signals.DeadZone dead(u=u, zone=0.5);
equation
  assert(abs(offset.y - u - 0.3) < 1e-15 and abs(gain.y - 0.9*u) < 1e-15, "Offset or gain");
  // A kink is rounded by half a width, 5e-4, at most.
  assert(abs(clipped.y - max(-1.0, min(1.0, u))) < 6e-4, "Not clipped at 1");
  assert(abs(oneSided.y - (if u > 1.0 then 0.5*(1.0 + u) else u)) < 6e-4, "Not half of what is above");
  assert(abs(dead.y - max(0.0, u - 0.5) - min(0.0, u + 0.5)) < 6e-4, "Not dead below 0.5");
  annotation (experiment(StopTime=1.0, Tolerance=1e-6));
end SignalsAreShiftedScaledAndClipped;
