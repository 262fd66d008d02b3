within LeakingChamber.Tests;
model WithoutHeatExpansionIsIsentropic "T/T0 = (p/p0)^((kappa - 1)/kappa), whatever the law of the leak"
  model Insulated "Walls that give no heat"
    extends Effects.ExpansionCooling(tau(max=1e9));
  end Insulated;
  Chamber laminar(
    dconductance=0.0, redeclare Effects.LaminarLeak leak(conductance=1e-9),
    redeclare Insulated heat(share=1.0, tau=1e9));
  Chamber hole(
    dconductance=0.0, redeclare Effects.OrificeLeak leak(C=1e-9),
    redeclare Insulated heat(share=1.0, tau=1e9));
protected
  Real T[2](each unit="1") "Temperature over that at the start, by the air that is left";
  Real left[2](each start=1.0, each fixed=true, each unit="1") "Share of the air that is left";
equation
  der(left[1]) = -laminar.q*287.05*293.15/(1e-4*8.013e5);
  der(left[2]) = -hole.q*287.05*293.15/(1e-4*8.013e5);
  T[1] = (laminar.p + 1.013e5)/8.013e5/left[1];
  T[2] = (hole.p + 1.013e5)/8.013e5/left[2];
  assert(
    abs(T[1] - ((laminar.p + 1.013e5)/8.013e5)^(0.4/1.4)) < 1e-6, "Laminar: not isentropic");
  assert(abs(T[2] - ((hole.p + 1.013e5)/8.013e5)^(0.4/1.4)) < 1e-6, "Hole: not isentropic");
  annotation (experiment(StopTime=2.0, Tolerance=1e-9));
end WithoutHeatExpansionIsIsentropic;
