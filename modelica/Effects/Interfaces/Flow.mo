within Effects.Interfaces;
partial model Flow "Slot: what flows from one pressure to another"
  input Units.Pressure p1 "Upstream, absolute";
  input Units.Pressure p2 "Downstream, absolute";
  output Units.MassFlowRate q "Mass flow rate from 1 to 2";
  annotation (Documentation(info="<html>
<p>What several effects in such a slot let through adds up. All laws hold for either sign of
<code>p1 - p2</code>.</p>
</html>"));
end Flow;
