within WheelsetRig.Tests;
model CaliperKeepsItsSide "Friction of the caliper takes force after a rise and gives it after a fall"
  Units.Pressure p = 3e5*noEvent(min(time, 1.0)) - 1e5*noEvent(max(0.0, min(time - 2.0, 1.0)))
    "Rises to 3 bar in 1 s, holds, falls to 2 bar from 2 s to 3 s, holds";
  Units.Pressure ripple = 500.0*sin(200.0*time) "What a valve leaves in hold";
  Effects.CaliperHysteresis caliper(pB=p + ripple, restBefore=0.0, share=0.05);
  Real loss(unit="1") = (p + ripple - caliper.p)/(p - 25000.0) "Share of force that is lost";
equation
  assert(abs(loss) < 0.051 or p < 50000.0, "The loss is not bounded");
  // The ripple of 500 Pa moves the side by 10 % of the play of 10 kPa, and the share by as much.
  assert(time < 0.5 or time > 2.0 or loss > 0.0445, "The rise is forgotten");
  assert(time < 2.5 or loss < -0.0445, "The fall is forgotten");
  assert(caliper.p > -1e-9 or p < 1000.0, "Pads pull");
  annotation (experiment(StopTime=6.0, Tolerance=1e-6));
end CaliperKeepsItsSide;
