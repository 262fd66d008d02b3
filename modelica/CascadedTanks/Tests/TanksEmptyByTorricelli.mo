within CascadedTanks.Tests;
model TanksEmptyByTorricelli "Without inflow the root of a level falls in proportion to time"
  Tanks tanks(pump=0.0, dk3=0.0, k1=0.4, level1(start=9.0)) "Upper tank, from 9 V";
  Real balance(unit="V", start=0.0, fixed=true) "What has left the lower tank";
equation
  der(balance) = tanks.outflow;
  // 1e-4: the root is off by (h0/(2*h))^2 = 3e-5 of itself at 1 V.
  assert(abs(sqrt(tanks.level1) - (3.0 - 0.2*time)) < 1e-4, "The upper tank empties otherwise");
  assert(abs(tanks.level1 + tanks.level2 + balance - 14.0) < 1e-5, "Water is lost");
  annotation (experiment(StopTime=10.0, Tolerance=1e-8));
end TanksEmptyByTorricelli;
