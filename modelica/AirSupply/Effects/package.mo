within AirSupply;
package Effects "What compressor, reservoir and what hangs on it may do beside the nominal model"
end Effects;
