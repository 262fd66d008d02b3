within AirSupply.Effects;
model CompressibleLeak "a laminar leak of a gas whose density follows the pressure"
  extends Common.Leaks.CompressibleLaminar(conductance(max=1e-8));
  annotation (
    __Workbench(effect(
      size="conductance", matters=1e-11,
      separation="the fall of the pressure from full to half with the compressor off")),
    Documentation(info="<html>
<p>Narrow gaps, over which the pressure falls by much.</p>
</html>"));
end CompressibleLeak;
