within PositioningStage.Tests;
model DampingDiffersBetweenDirections "200 less 40 N.s/m one way, 200 and 40 the other"
  Effects.SlantedDamping there(v=0.1, load=0.0, slant=-40.0);
  Effects.SlantedDamping back(v=-0.1, load=0.0, slant=-40.0);
  Effects.CableSpring cables(position=0.2, k=30.0);
equation
  assert(abs(200.0*0.1 + there.f - 16.0) < 1e-12, "Not less there");
  assert(abs(-200.0*0.1 + back.f + 24.0) < 1e-12, "Not more back");
  assert(abs(cables.f - 6.0) < 1e-12, "Not in proportion to the position");
  annotation (experiment(StopTime=0.1, Tolerance=1e-6));
end DampingDiffersBetweenDirections;
