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
  assert(none.f == 0.0 and dry.f == 0.0 and viscous.f == 0.0 and stribeck.f == 0.0
    and loaded.f == 0.0 and quadratic.f == 0.0, "Friction");
  assert(turningDry.f == 0.0 and turningViscous.f == 0.0 and turningStribeck.f == 0.0
    and turningLoaded.f == 0.0 and turningQuadratic.f == 0.0, "Friction of turning motion");
  assert(tight.q == 0.0 and steady.q == 0.0 and laminar.q == 0.0 and compressible.q == 0.0
    and orifice.q == 0.0, "A leak");
  assert(unchanged.y == x and offset.y == x and gain.y == x and delay.y == x and lag.y == x
    and saturation.y == x and backlash.y == x and hysteresis.y == x, "A signal");
  // The two halves of u round once each.
  assert(abs(deadZone.y - x) < 1e-15, "A dead zone");
  annotation (experiment(StopTime=2.0, Tolerance=1e-6));
end SizeZeroIsNominal;
