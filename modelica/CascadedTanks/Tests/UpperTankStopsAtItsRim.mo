within CascadedTanks.Tests;
model UpperTankStopsAtItsRim "A tank that overflows stays at its rim, and what runs over is shared"
  Effects.UpperOverflow rim(h=h, surplus=surplus, spilled=1.0, rim=6.0, share=0.25);
  Effects.UpperOverflow higher(h=h, surplus=surplus, spilled=1.0, rim=8.0);
  Real h(unit="V", start=5.0, fixed=true) "Level";
  Real surplus(unit="V/s") = 1.2 - 0.1*time - 0.1*h "Of an inflow that ends";
equation
  der(h) = surplus - rim.leaves;
  assert(h < 6.3, "The level is above the rim by more than three times its width");
  assert(abs(rim.caught - 0.25*rim.leaves) < 1e-12, "Not shared as said");
  // Within the width of the rim, an eighth of the surplus still lifts the level.
  assert(abs(time - 4.5) > 0.5 or abs(rim.leaves - surplus) < 0.15*surplus,
    "Not all of the surplus runs over");
  assert(time < 7.0 or rim.leaves < 1e-5, "It runs over without a surplus");
  assert(higher.leaves < 1e-6, "It runs over below the rim");
  annotation (experiment(StopTime=10.0, Tolerance=1e-8));
end UpperTankStopsAtItsRim;
