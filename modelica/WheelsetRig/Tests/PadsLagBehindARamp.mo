within WheelsetRig.Tests;
model PadsLagBehindARamp "On a ramp the pads are late by the lag, in hold by nothing"
  Units.Pressure p = 2e5*noEvent(min(time, 1.5)) "Measured pressure";
  Effects.CylinderLag late(pB=p, restBefore=100.0, lag=0.05);
  Effects.CylinderLag short(pB=p, restBefore=0.0, lag=0.002);
equation
  // 1 Pa of 400 Pa and 10 kPa: exp(-t/T) after 0.5 s is 6e-5 of the lag.
  assert(time < 0.5 or time > 1.5 or abs(p - late.p - 0.05*2e5) < 1.0, "Lag of 50 ms on a ramp");
  assert(time < 0.5 or time > 1.5 or abs(p - short.p - 0.002*2e5) < 1.0, "Lag of 2 ms on a ramp");
  assert(time < 2.0 or abs(p - late.p) < 1.0, "Lag in hold");
  assert(abs(late.rest - 100.0) < 1e-9, "Pressure at rest");
  annotation (experiment(StopTime=2.5, Tolerance=1e-8));
end PadsLagBehindARamp;
