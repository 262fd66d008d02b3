within HeatedHouse.Tests;
model HeatIsKept "What the air lost to walls is in them, or outside"
  Effects.ShellStore shell(nominal=4000.0, T=293.0, G=200.0, heavy=0.75, inside=0.3,
    lag(min=1.0)=20.0);
  Real balance(unit="J", start=0.0, fixed=true, nominal=1e5) "In less out";
equation
  // Outside it is 273 K. A quarter goes there at once, the rest through two resistances.
  der(balance) = shell.actual - 1000.0 - 150.0/0.7*(shell.Te - 273.0);
  assert(abs(shell.Ce - 150.0*20.0/0.21) < 1e-9, "No lag of both resistances in parallel");
  assert(abs(balance - shell.Ce*(shell.Te - 290.0)) < 1e-3, "Heat is lost or made");
  annotation (experiment(StopTime=50.0, Tolerance=1e-9));
end HeatIsKept;
