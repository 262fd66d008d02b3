within Effects.Tests;
model SizeZeroIsNominal "No law has an effect by default"
  Real v = 0.3*cos(6.0*time) "Velocity, through zero";
  Real x(start=0.2, fixed=true) "Signal";
  Units.Pressure p = 1e5*(1.5 + cos(6.0*time)) "Above and below 1 bar";
  Friction.Frictionless none(v=v, load=10.0);
  Friction.Dry dry(v=v, load=10.0);
  Friction.Viscous viscous(v=v, load=10.0);
  Friction.Stribeck stribeck(v=v, load=10.0);
  Friction.LoadDependent loaded(v=v, load=10.0);
  Friction.Quadratic quadratic(v=v, load=10.0);
  RotationalFriction.Dry turningDry(v=v, load=10.0);
  RotationalFriction.Viscous turningViscous(v=v, load=10.0);
  RotationalFriction.Stribeck turningStribeck(v=v, load=10.0);
  RotationalFriction.LoadDependent turningLoaded(v=v, load=10.0);
  RotationalFriction.Quadratic turningQuadratic(v=v, load=10.0);
  Leaks.Tight tight(p1=p, p2=1e5);
  Leaks.Steady steady(p1=p, p2=1e5);
  Leaks.Laminar laminar(p1=p, p2=1e5);
  Leaks.CompressibleLaminar compressible(p1=p, p2=1e5);
  Leaks.Orifice orifice(p1=p, p2=1e5);
  Signals.Unchanged unchanged(u=x);
  Signals.Offset offset(u=x);
  Signals.Gain gain(u=x);
  Signals.Delay delay(u=x);
  Signals.Lag lag(u=x);
  Signals.Saturation saturation(u=x, high=0.1);
  Signals.DeadZone deadZone(u=x);
  Signals.Backlash backlash(u=x);
  Signals.Hysteresis hysteresis(u=x);
equation
  der(x) = 3.0*cos(6.0*time);
  // Modelica compares numbers for equality in functions alone: "<= 0.0" is exact, too.
  assert(abs(none.f) + abs(dry.f) + abs(viscous.f) + abs(stribeck.f) + abs(loaded.f)
    + abs(quadratic.f) <= 0.0, "Friction");
  assert(abs(turningDry.f) + abs(turningViscous.f) + abs(turningStribeck.f) + abs(turningLoaded.f)
    + abs(turningQuadratic.f) <= 0.0, "Friction of turning motion");
  assert(abs(tight.q) + abs(steady.q) + abs(laminar.q) + abs(compressible.q) + abs(orifice.q) <= 0.0,
    "A leak");
  assert(abs(unchanged.y - x) + abs(offset.y - x) + abs(gain.y - x) + abs(delay.y - x)
    + abs(lag.y - x) + abs(saturation.y - x) + abs(backlash.y - x) + abs(hysteresis.y - x) <= 0.0,
    "A signal");
  // The two halves of u round once each.
  assert(abs(deadZone.y - x) < 1e-15, "A dead zone");
  annotation (experiment(StopTime=2.0, Tolerance=1e-6));
end SizeZeroIsNominal;
